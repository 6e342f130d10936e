// Force laws of a scene that need no Python: springs in joints and between frames, and constant wrenches. Twin of
// scene/forces.py, scene/pose_spring.py and constraints/frame_forces.py.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "cable.hpp"
#include "mechanism.hpp"
#include "rod.hpp"

namespace nga {

class ForceLaws {
public:
    // live, at: what is computed of the bodies, and where they are. before: by rows, whether a coordinate (second index)
    // moves the axis of another one, nv x nv.
    ForceLaws(const kernel::Live &live, const Mechanism &at, std::vector<double> before);

    // A spring on a sum of joint coordinates. row: its derivative by v; places: in q of its parts, or, where it has a
    // period, of cosine and sine of a continuous joint; factors: of the parts. Numbers: stiffness, lower and upper end of
    // the range without force, damping.
    void add_joint_spring(std::vector<double> row, std::vector<int> places, std::vector<double> factors, double period);

    // A spring of a ball joint or, moves, of a free one. q, v: its places. Numbers: stiffness, position and quaternion
    // (x, y, z, w) without force; of a ball joint the position does not count.
    void add_pose_spring(int q, int v, bool moves);

    // A spring between points of two joints. on_a, on_b: which coordinates move them. Numbers: stiffness, rest, damping.
    void add_spring(int a, int b, std::vector<double> point_a, std::vector<double> point_b, std::vector<double> on_a,
                    std::vector<double> on_b);

    // A wrench at a frame of a joint. rotation: by columns. Numbers: force and moment.
    void add_wrench(int joint, std::vector<double> rotation, std::vector<double> translation, std::vector<double> on,
                    bool local);

    // A rod: places of its first node in q and in v. It has no numbers.
    void add_rod(const Rod &rod, int q, int v);

    // A cable, likewise.
    void add_cable(const Cable &cable, int q, int v);

    // The numbers of all laws in their order, of joint springs before those of pose springs, of springs and of wrenches.
    void set(std::vector<double> numbers);

    // Adds the generalized force and its derivatives by q and v, by columns, where the bodies are.
    void add(const Eigen::VectorXd &q, const Eigen::VectorXd &v, double *tau, double *K, double *D) const;

private:
    struct JointSpring {
        std::vector<double> row;
        std::vector<int> places;
        std::vector<double> factors;
        double period;
    };
    struct PoseSpring {
        int q, v;
        bool moves;
    };
    struct Spring {
        int a, b;
        std::vector<double> point_a, point_b, on_a, on_b;
    };
    struct Wrench {
        int joint;
        std::vector<double> rotation, translation, on;
        bool local;
    };
    template <class Strand>
    struct Placed {
        Strand strand;
        int q, v;
    };
    struct Sums {
        const Eigen::VectorXd &q, &v;
        double *tau, *K, *D;
    };
    std::size_t count() const {
        return 4 * joint_springs_.size() + 8 * pose_springs_.size() + 3 * springs_.size() + 6 * wrenches_.size();
    }
    void add_one(const JointSpring &spring, const double *numbers, const Sums &to) const;
    void add_one(const PoseSpring &spring, const double *numbers, const Sums &to) const;
    void add_one(const Spring &spring, const double *numbers, const Sums &to) const;
    void add_one(const Wrench &wrench, const double *numbers, const Sums &to) const;
    template <class Strand>
    void add_all(const std::vector<Placed<Strand>> &strands, const Sums &to) const;
    double turning(int i, int l, const double *J, const double *F) const;

    const kernel::Live &live_;
    const Mechanism &at_;
    const int nv_;
    std::vector<double> before_, numbers_;
    std::vector<JointSpring> joint_springs_;
    std::vector<PoseSpring> pose_springs_;
    std::vector<Spring> springs_;
    std::vector<Wrench> wrenches_;
    std::vector<Placed<Rod>> rods_;
    std::vector<Placed<Cable>> cables_;
};

}  // namespace nga
