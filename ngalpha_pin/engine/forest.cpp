#include "forest.hpp"

#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

namespace nga {
namespace {

using Given = Eigen::Ref<const Eigen::VectorXd>;  // what the libraries have instantiated; other types take minutes

struct Part {
    pinocchio::Model model;
    pinocchio::Data data;
    Eigen::VectorXd q, v, a, moved;
};

// The tree of some joints of a model as a model of its own.
pinocchio::Model tree_of(const pinocchio::Model &whole, const std::vector<int> &joints, const std::vector<int> &dofs) {
    pinocchio::Model tree;
    tree.gravity = whole.gravity;
    std::vector<pinocchio::JointIndex> number(whole.njoints, 0);
    for (int joint : joints) {
        number[joint] = tree.addJoint(number[whole.parents[joint]], whole.joints[joint], whole.jointPlacements[joint],
                                      whole.names[joint]);
        tree.appendBodyToJoint(number[joint], whole.inertias[joint]);
    }
    for (int i = 0; i < tree.nv; ++i) tree.armature[i] = whole.armature[dofs[i]];
    return tree;
}

}  // namespace

struct Forest::Parts {
    std::vector<Part> each;
};

Forest::Forest(const std::string &text) : parts_(new Parts) {
    pinocchio::Model whole;
    whole.loadFromString(text);
    of_q_.assign(whole.nq, -1), of_v_.assign(whole.nv, -1), of_joint_.assign(whole.njoints, -1);
    for (int joint = 1; joint < whole.njoints; ++joint) {
        const int parent = static_cast<int>(whole.parents[joint]);
        if (parent == 0) trees.emplace_back();
        const int tree = of_joint_[joint] = parent == 0 ? count() - 1 : of_joint_[parent];
        trees[tree].joints.push_back(joint);
        for (int i = 0; i < whole.nqs[joint]; ++i)
            of_q_[whole.idx_qs[joint] + i] = tree, trees[tree].q.push_back(whole.idx_qs[joint] + i);
        for (int i = 0; i < whole.nvs[joint]; ++i)
            of_v_[whole.idx_vs[joint] + i] = tree, trees[tree].v.push_back(whole.idx_vs[joint] + i);
    }
    for (Tree &tree : trees) {
        pinocchio::Model model = tree_of(whole, tree.joints, tree.v);
        const int n = model.nv;
        tree.M = tree.K = tree.D = Matrix::Zero(n, n), tree.T = Matrix::Identity(n, n);
        const Vector q = pinocchio::neutral(model), none = Vector::Zero(n);
        pinocchio::Data data(model);
        parts_->each.push_back({std::move(model), std::move(data), q, none, none, q});
    }
    J_.setZero(6, whole.nv), dJ_ = dAdv_ = J_, residual.setZero(whole.nv);
    poses_.resize(whole.njoints);
    poses_[0] << 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0;
}

Forest::~Forest() = default;

void Forest::gather(int tree, const Vector &q, const Vector &v) {
    Part &part = parts_->each[tree];
    for (std::size_t i = 0; i < trees[tree].q.size(); ++i) part.q[i] = q[trees[tree].q[i]];
    for (std::size_t i = 0; i < trees[tree].v.size(); ++i) part.v[i] = v[trees[tree].v[i]];
}

// Jacobians, their rates and poses, where they belong among those of all trees.
void Forest::keep(int tree) {
    const Part &part = parts_->each[tree];
    const Tree &of = trees[tree];
    for (std::size_t i = 0; i < of.v.size(); ++i)
        J_.col(of.v[i]) = part.data.J.col(i), dJ_.col(of.v[i]) = part.data.dJ.col(i);
    for (std::size_t i = 0; i < of.joints.size(); ++i) {
        const auto &pose = part.data.oMi[i + 1];
        Eigen::Map<Eigen::Matrix3d>(poses_[of.joints[i]].data()) = pose.rotation();
        poses_[of.joints[i]].tail<3>() = pose.translation();
    }
}

void Forest::integrate(const Vector &q, const Vector &dq, Vector &moved) {
    for (int tree = 0; tree < count(); ++tree) {
        gather(tree, q, dq);
        Part &part = parts_->each[tree];
        pinocchio::integrate(part.model, part.q, part.v, part.moved);
        for (std::size_t i = 0; i < trees[tree].q.size(); ++i) moved[trees[tree].q[i]] = part.moved[i];
    }
}

void Forest::differentiate_step(const Vector &q, const Vector &dq) {
    for (int tree = 0; tree < count(); ++tree) {
        gather(tree, q, dq);
        Part &part = parts_->each[tree];
        trees[tree].T.setZero();
        pinocchio::dIntegrate(part.model, part.q, part.v, trees[tree].T, pinocchio::ARG1);
    }
}

void Forest::dynamics(const Vector &q, const Vector &v, const Vector &a) {
    for (int t = 0; t < count(); ++t) {
        gather(t, q, v);
        Part &part = parts_->each[t];
        Tree &tree = trees[t];
        for (std::size_t i = 0; i < tree.v.size(); ++i) part.a[i] = a[tree.v[i]];
        pinocchio::computeRNEADerivatives(part.model, part.data, Given(part.q), Given(part.v), Given(part.a));
        keep(t);
        tree.M = part.data.M.selfadjointView<Eigen::Upper>();
        tree.K = part.data.dtau_dq, tree.D = part.data.dtau_dv;
        for (std::size_t i = 0; i < tree.v.size(); ++i)
            dAdv_.col(tree.v[i]) = part.data.dAdv.col(i), residual[tree.v[i]] = part.data.tau[i];
    }
}

void Forest::move(const Vector &q, const Vector &v) {
    for (int tree = 0; tree < count(); ++tree) {
        gather(tree, q, v);
        Part &part = parts_->each[tree];
        pinocchio::computeJointJacobiansTimeVariation(part.model, part.data, Given(part.q), Given(part.v));
        keep(tree);
    }
}

void Forest::show(kernel::Live &live) const {
    live.J = J_.data(), live.dJ = dJ_.data(), live.dAdv = dAdv_.data(), live.residual = residual.data();
}

}  // namespace nga
