// Which pairs of solids are near, without looking at the others; see collision/broad_phase.py.
#pragma once
#include <memory>
#include <vector>

#include "shape_pair.hpp"

namespace nga {

// Poses and velocities of all joints, where Pinocchio writes them.
struct Bodies {
    std::vector<const double *> rotations, translations, linear, angular;

    Pose pose(int joint) const { return {Eigen::Map<const Matrix>(rotations[joint]), at(translations[joint])}; }
    Pose pose(int a, int b) const;  // of joint b in joint a
    Vector omega(int joint) const { return at(angular[joint]); }
    Vector velocity(int joint) const { return at(linear[joint]); }

private:
    static Vector at(const double *x) { return Eigen::Map<const Vector>(x); }
};

// What is fixed of all pairs.
struct Pairs {
    std::vector<ShapePair> shapes;
    std::vector<int> a, b;
    std::vector<Vector> centres_a, centres_b, walls;
    std::vector<double> size_b, radii, doubt, extent;  // the last of every joint
    std::vector<char> two_sided;
    double typical;

    int n() const { return static_cast<int>(shapes.size()); }
};

class NearPairs {
public:
    explicit NearPairs(std::shared_ptr<const Pairs> pairs);

    const Pairs &pairs() const { return *pairs_; }
    std::shared_ptr<const Pairs> shared() const { return pairs_; }

    // Numbers of the pairs whose distance is not above a reach and what they approach each other within a time `ahead`.
    std::vector<int> within(const Bodies &bodies, double reach, double ahead);

    // Those of some pairs that spheres around them do not prove to be farther than `reach`, with lower bounds.
    void bounds(const Bodies &bodies, const std::vector<int> &among, const std::vector<double> &reach,
                std::vector<int> &found, std::vector<double> &lower) const;

    // Distance of a pair [m].
    double look(const Bodies &bodies, int i);

    // Whether every pair is farther apart than it can approach within a time `ahead`, from spheres and from what the last
    // looks leave of its distance, without another look.
    bool all_apart(const Bodies &bodies, double ahead) const;

    // Bound of the speed of any point of B seen from A of a pair [m/s].
    double speed(const Bodies &bodies, int i) const;

    // The last looks: of all pairs distance, centre and axes (by rows) of B; of all joints at the last look at all pairs;
    // the pairs that are listed since, and how far the others were [m].
    std::vector<double> found, x, R, seen_R, seen_p;
    std::vector<int> listed;
    double others_from = -INFINITY;
    bool seen = false;
    long looks = 0;  // at the distance of a pair

private:
    const std::vector<int> &near(const Bodies &bodies, double most);
    double spheres(const Bodies &bodies, int i) const;
    double remembered(const Bodies &bodies, int i) const;
    double way(const Bodies &bodies, int joint) const;
    double furthest(const Bodies &bodies) const;
    double fastest(const Bodies &bodies) const;
    std::shared_ptr<const Pairs> pairs_;
    std::vector<int> every_;
};

}  // namespace nga
