#include "mechanism.hpp"

#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

namespace nga {
namespace {

using Given = Eigen::Ref<const Eigen::VectorXd>;  // what the libraries have instantiated; other types take minutes

pinocchio::Model model_of(const std::string &text) {
    pinocchio::Model model;
    model.loadFromString(text);
    return model;
}

template <class M>
kernel::Matrix strided(const M &A) {
    return {A.data(), static_cast<long>(A.rowStride()), static_cast<long>(A.colStride())};
}

}  // namespace

struct Mechanism::Parts {
    explicit Parts(const std::string &text) : model(model_of(text)), data(model), T(model.nv, model.nv) {}
    pinocchio::Model model;
    pinocchio::Data data;
    Eigen::MatrixXd T;
};

Mechanism::Mechanism(const std::string &text, Beams beams) : parts_(new Parts(text)), beams_(std::move(beams)) {
    if (beams_.empty()) return;
    q_ = pinocchio::neutral(parts_->model);
    u_ = u_dot_ = Eigen::VectorXd::Zero(parts_->model.nv);
    residual_ = Eigen::VectorXd::Zero(nv());
    M_ = K_ = D_ = Eigen::MatrixXd::Zero(nv(), nv());
    beams_.show(shapes_);
    shapes_.nt = nv_tree(), shapes_.u = u_.data(), shapes_.u_dot = u_dot_.data();
}
Mechanism::~Mechanism() = default;

int Mechanism::nq_tree() const { return parts_->model.nq - 3 * beams_.points(); }
int Mechanism::nv_tree() const { return parts_->model.nv - 3 * beams_.points(); }
int Mechanism::nq() const { return nq_tree() + beams_.size(); }
int Mechanism::nv() const { return nv_tree() + beams_.size(); }

// Puts the coordinates of all joints.
void Mechanism::move(const Eigen::VectorXd &q, const Eigen::VectorXd &v, const Eigen::VectorXd &a) {
    const int mq = nq_tree(), mv = nv_tree();
    q_.head(mq) = q.head(mq), u_.head(mv) = v.head(mv), u_dot_.head(mv) = a.head(mv);
    beams_.move(q.data() + mq, v.data() + mv, a.data() + mv, q_.data() + mq, u_.data() + mv, u_dot_.data() + mv);
}

void Mechanism::dynamics(const Eigen::VectorXd &q, const Eigen::VectorXd &v, const Eigen::VectorXd &a) {
    auto &data = parts_->data;
    const bool rigid = beams_.empty();
    if (!rigid) move(q, v, a);
    if (parts_->model.nv)
        pinocchio::computeRNEADerivatives(parts_->model, data, Given(rigid ? q : q_), Given(rigid ? v : u_),
                                          Given(rigid ? a : u_dot_));
    data.M.triangularView<Eigen::StrictlyLower>() = data.M.transpose().triangularView<Eigen::StrictlyLower>();
    if (rigid) return;
    const int n = nv_tree(), mq = nq_tree();
    residual_.head(n) = data.tau.head(n), residual_.tail(beams_.size()).setZero();
    M_.topLeftCorner(n, n) = data.M.topLeftCorner(n, n);
    K_.topLeftCorner(n, n) = data.dtau_dq.topLeftCorner(n, n);
    D_.topLeftCorner(n, n) = data.dtau_dv.topLeftCorner(n, n);
    const long stride = nv(), corner = n * (1 + stride);
    beams_.dynamics(q.data() + mq, v.data() + n, a.data() + n, residual_.data() + n, M_.data() + corner,
                    K_.data() + corner, D_.data() + corner, stride);
}

void Mechanism::jacobians(const Eigen::VectorXd &q, const Eigen::VectorXd &v) {
    const bool rigid = beams_.empty();
    if (!rigid) move(q, v, Eigen::VectorXd::Zero(nv()));
    pinocchio::computeJointJacobiansTimeVariation(parts_->model, parts_->data, Given(rigid ? q : q_), Given(rigid ? v : u_));
}

void Mechanism::place(const Eigen::VectorXd &q, const Eigen::VectorXd &v) {
    const bool rigid = beams_.empty();
    if (!rigid) move(q, v, Eigen::VectorXd::Zero(nv()));
    pinocchio::forwardKinematics(parts_->model, parts_->data, Given(rigid ? q : q_), Given(rigid ? v : u_));
}

void Mechanism::integrate(const Eigen::VectorXd &q, const Eigen::VectorXd &dq, Eigen::VectorXd &moved) const {
    if (beams_.empty()) return pinocchio::integrate(parts_->model, q, dq, moved);
    const int mq = nq_tree(), n = nv_tree(), b = beams_.size();
    moved.tail(b) = q.tail(b) + dq.tail(b);
    if (mq == 0) return;
    Eigen::VectorXd joints = q_, step = Eigen::VectorXd::Zero(u_.size()), found(q_.size());
    joints.head(mq) = q.head(mq), step.head(n) = dq.head(n);
    pinocchio::integrate(parts_->model, joints, step, found);
    moved.head(mq) = found.head(mq);
}

void Mechanism::d_integrate(const Eigen::VectorXd &q, const Eigen::VectorXd &dq, double *T) {
    parts_->T.setZero();
    Eigen::Map<Eigen::MatrixXd> found(T, nv(), nv());
    if (beams_.empty()) {
        pinocchio::dIntegrate(parts_->model, q, dq, parts_->T, pinocchio::ARG1);
        found = parts_->T;
        return;
    }
    const int mq = nq_tree(), n = nv_tree();
    Eigen::VectorXd joints = q_, step = Eigen::VectorXd::Zero(u_.size());
    joints.head(mq) = q.head(mq), step.head(n) = dq.head(n);
    pinocchio::dIntegrate(parts_->model, joints, step, parts_->T, pinocchio::ARG1);
    found.setIdentity();
    found.topLeftCorner(n, n) = parts_->T.topLeftCorner(n, n);
}

void Mechanism::show(kernel::Live &live) const {
    const auto &data = parts_->data;
    live.J = data.J.data(), live.dJ = data.dJ.data(), live.dAdv = data.dAdv.data();
    live.residual = data.tau.data();
    live.M = strided(data.M), live.K = strided(data.dtau_dq), live.D = strided(data.dtau_dv);
    if (beams_.empty()) return;
    live.residual = residual_.data(), live.shapes = &shapes_;
    live.M = strided(M_), live.K = strided(K_), live.D = strided(D_);
}

const double *Mechanism::rotation(int joint) const { return parts_->data.oMi[joint].rotation().data(); }
const double *Mechanism::translation(int joint) const { return parts_->data.oMi[joint].translation().data(); }
const double *Mechanism::linear(int joint) const { return parts_->data.v[joint].toVector().data(); }
const double *Mechanism::angular(int joint) const { return parts_->data.v[joint].toVector().data() + 3; }

}  // namespace nga
