// A pinocchio::Model and what its dynamics have written last. No other file of the engine calls Pinocchio.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "kernel/kernel.hpp"

namespace nga {

class Mechanism {
public:
    // text: archive of the model, as `pin.Model.saveToString` writes it.
    explicit Mechanism(const std::string &text);
    ~Mechanism();
    Mechanism(const Mechanism &) = delete;
    Mechanism &operator=(const Mechanism &) = delete;

    int nq() const;
    int nv() const;

    // M, M a + nle and their derivatives, Jacobians and their rates, poses of all joints.
    void dynamics(const Eigen::VectorXd &q, const Eigen::VectorXd &v, const Eigen::VectorXd &a);

    // Jacobians, their rates and poses alone.
    void jacobians(const Eigen::VectorXd &q, const Eigen::VectorXd &v);

    // Poses and velocities of all joints alone.
    void place(const Eigen::VectorXd &q, const Eigen::VectorXd &v);

    // The configuration after the tangent step dq, and its derivative by dq, nv x nv by columns.
    void integrate(const Eigen::VectorXd &q, const Eigen::VectorXd &dq, Eigen::VectorXd &moved) const;
    void d_integrate(const Eigen::VectorXd &q, const Eigen::VectorXd &dq, double *T);

    // Where the above is written, for the rows and the equations of a step.
    void show(kernel::Live &live) const;
    const double *rotation(int joint) const;
    const double *translation(int joint) const;

    // Velocity of a joint in its own axes.
    const double *linear(int joint) const;
    const double *angular(int joint) const;

private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace nga
