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

Mechanism::Mechanism(const std::string &text) : parts_(new Parts(text)) {}
Mechanism::~Mechanism() = default;

int Mechanism::nq() const { return parts_->model.nq; }
int Mechanism::nv() const { return parts_->model.nv; }

void Mechanism::dynamics(const Eigen::VectorXd &q, const Eigen::VectorXd &v, const Eigen::VectorXd &a) {
    auto &data = parts_->data;
    pinocchio::computeRNEADerivatives(parts_->model, data, Given(q), Given(v), Given(a));
    data.M.triangularView<Eigen::StrictlyLower>() = data.M.transpose().triangularView<Eigen::StrictlyLower>();
}

void Mechanism::jacobians(const Eigen::VectorXd &q, const Eigen::VectorXd &v) {
    pinocchio::computeJointJacobiansTimeVariation(parts_->model, parts_->data, Given(q), Given(v));
}

void Mechanism::place(const Eigen::VectorXd &q, const Eigen::VectorXd &v) {
    pinocchio::forwardKinematics(parts_->model, parts_->data, Given(q), Given(v));
}

void Mechanism::integrate(const Eigen::VectorXd &q, const Eigen::VectorXd &dq, Eigen::VectorXd &moved) const {
    pinocchio::integrate(parts_->model, q, dq, moved);
}

void Mechanism::d_integrate(const Eigen::VectorXd &q, const Eigen::VectorXd &dq, double *T) {
    parts_->T.setZero();
    pinocchio::dIntegrate(parts_->model, q, dq, parts_->T, pinocchio::ARG1);
    Eigen::Map<Eigen::MatrixXd>(T, nv(), nv()) = parts_->T;
}

void Mechanism::show(kernel::Live &live) const {
    const auto &data = parts_->data;
    live.J = data.J.data(), live.dJ = data.dJ.data(), live.dAdv = data.dAdv.data();
    live.residual = data.tau.data();
    live.M = strided(data.M), live.K = strided(data.dtau_dq), live.D = strided(data.dtau_dv);
}

const double *Mechanism::rotation(int joint) const { return parts_->data.oMi[joint].rotation().data(); }
const double *Mechanism::translation(int joint) const { return parts_->data.oMi[joint].translation().data(); }
const double *Mechanism::linear(int joint) const { return parts_->data.v[joint].toVector().data(); }
const double *Mechanism::angular(int joint) const { return parts_->data.v[joint].toVector().data() + 3; }

}  // namespace nga
