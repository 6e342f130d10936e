// A pinocchio::Model with the beams beside it, and what their dynamics have written last. No other file of the engine calls
// Pinocchio. Coordinates are those of the tree and then those of the beams; joints of the model behind those of the tree
// are points of the beams.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "beams.hpp"

namespace nga {

class Mechanism {
public:
    // text: archive of the model, as `pin.Model.saveToString` writes it.
    Mechanism(const std::string &text, Beams beams);
    ~Mechanism();
    Mechanism(const Mechanism &) = delete;
    Mechanism &operator=(const Mechanism &) = delete;

    int nq() const;
    int nv() const;

    // Coordinates and velocities of the tree alone.
    int nq_tree() const;
    int nv_tree() const;
    const Beams &beams() const { return beams_; }

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
    void move(const Eigen::VectorXd &q, const Eigen::VectorXd &v, const Eigen::VectorXd &a);
    std::unique_ptr<Parts> parts_;
    Beams beams_;
    Eigen::VectorXd q_, u_, u_dot_;  // of all joints, where there are beams
    Eigen::VectorXd residual_;
    Eigen::MatrixXd M_, K_, D_;      // of tree and beams
    kernel::Shapes shapes_{};
};

}  // namespace nga
