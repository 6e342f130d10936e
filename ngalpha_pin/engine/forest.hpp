// Many mechanisms side by side, each with a pinocchio::Model of its own: one of all of them has tensors of size nv^3.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "kernel/kernel.hpp"

namespace nga {

class Forest {
public:
    using Matrix = Eigen::MatrixXd;
    using Vector = Eigen::VectorXd;

    // What one tree has at the last call of `dynamics` and `differentiate_step`.
    struct Tree {
        std::vector<int> q, v, joints;  // where its coordinates, velocities and joints are among all
        Matrix M, K, D, T;              // mass matrix, derivatives of the residual by q and v, and of `integrate`
    };

    explicit Forest(const std::string &text);
    ~Forest();

    int nq() const { return static_cast<int>(of_q_.size()); }
    int nv() const { return static_cast<int>(of_v_.size()); }
    int count() const { return static_cast<int>(trees.size()); }
    int of_joint(int joint) const { return of_joint_[joint]; }  // -1 of the world
    int of_dof(int v) const { return of_v_[v]; }

    void integrate(const Vector &q, const Vector &dq, Vector &moved);
    void differentiate_step(const Vector &q, const Vector &dq);
    void dynamics(const Vector &q, const Vector &v, const Vector &a);
    void move(const Vector &q, const Vector &v);  // Jacobians and their rates alone

    // Shows what the kernel reads: world Jacobians, their rates, and the residual.
    void show(kernel::Live &live) const;
    const double *rotation(int joint) const { return poses_[joint].data(); }
    const double *translation(int joint) const { return poses_[joint].data() + 9; }

    std::vector<Tree> trees;
    Vector residual;

private:
    struct Parts;
    void gather(int tree, const Vector &q, const Vector &v);
    void keep(int tree);

    std::unique_ptr<Parts> parts_;
    std::vector<int> of_q_, of_v_, of_joint_;
    std::vector<Eigen::Matrix<double, 12, 1>> poses_;
    Eigen::Matrix<double, 6, Eigen::Dynamic> J_, dJ_, dAdv_;
};

}  // namespace nga
