// Convex shapes and what they offer to a contact, in the frame of their joint; directions m are outward unit vectors.
#pragma once
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "exposed.hpp"
#include "features.hpp"

namespace nga {

// Rotation of a shape in a step in its own frame [rad]; none where corners must be fixed points.
using Turn = std::optional<Vector>;

constexpr double STANDS = 0.8;  // cosine between normal and axis from which a cap may come to rest as a whole

class Solid {
public:
    Solid(Vector centre, double size) : centre(std::move(centre)), size(size) {}
    virtual ~Solid() = default;

    // The farthest point in a direction.
    virtual Vector support(const Vector &m) const = 0;
    // The feature that the point p of the surface belongs to.
    virtual Feature feature_at(const Vector &p, const Vector &m) const = 0;
    // The flat side that is surface and whose normal has a cosine above `aligned` with m, if there is one.
    virtual std::optional<Face> face(const Vector &m, double aligned = ALIGNED) const = 0;
    // Features that may touch a plane with the normal -m.
    virtual Corners corners(const Vector &m, const Turn &turn) const = 0;
    // Of all faces the one that is surface and from which `other`, at X, is farthest; only of a polytope with neighbours.
    virtual std::optional<Face> farthest_face(const Solid &, const Pose &) const { return std::nullopt; }
    // What of it is surface beside other pieces of its body; null for all of it.
    virtual const Exposed *exposed() const { return nullptr; }

    const Vector centre;
    const double size;  // diameter of a sphere about the centre that holds all of it [m]
};

// A sphere, a capsule or an ellipsoid: a point or a segment with a smooth surface around it.
class Round final : public Solid {
public:
    Round(Vector centre, Vector half, Matrix Q, double r, double size)
        : Solid(std::move(centre), size), half_(std::move(half)), Q_(std::move(Q)), r_(r) {}
    Vector support(const Vector &m) const override;
    Feature feature_at(const Vector &p, const Vector &m) const override;
    std::optional<Face> face(const Vector &, double) const override { return std::nullopt; }
    Corners corners(const Vector &m, const Turn &turn) const override;

private:
    Corner end(double sign) const { return {centre + sign * half_, Q_, r_, false}; }
    Vector half_;
    Matrix Q_;
    double r_;
};

// A cylinder or a cone: discs about an axis, the second one of radius zero for a cone, and their hull.
class Turned final : public Solid {
public:
    Turned(Vector first, Vector second, Vector axis, double radius_1, double radius_2, double r, Vector centre, double size);
    Vector support(const Vector &m) const override;
    Feature feature_at(const Vector &p, const Vector &m) const override;
    std::optional<Face> face(const Vector &m, double aligned) const override;
    Corners corners(const Vector &m, const Turn &turn) const override;

private:
    Feature rim_at(int i) const { return rim(ends_[i], axis_, radii_[i], r_); }
    void points_of_rim(int i, const Vector &across, double sine, bool stands, const Turn &turn, Corners &found) const;
    Vector ends_[2], axis_;
    double radii_[2], r_;
    Face caps_[2];
};

// A half-space, or a plane that is touched from both sides.
class Wall final : public Solid {
public:
    Wall(Vector normal, Vector centre, bool two_sided);
    Vector support(const Vector &) const override { return centre; }
    Feature feature_at(const Vector &, const Vector &) const override { return plane(centre, normal, 0.0); }
    std::optional<Face> face(const Vector &m, double) const override;
    Corners corners(const Vector &, const Turn &) const override { return {}; }

    const Vector normal;
    const bool two_sided;
};

// The hull of points, swept by a sphere; see collision/polytope.py.
class Polytope final : public Solid {
public:
    using Table = Eigen::Matrix<double, Eigen::Dynamic, 3>;
    using Edges = Eigen::Matrix<int, Eigen::Dynamic, 4>;
    // sides: of every face its corners in order about the normal.
    Polytope(Table V, Table normals, Eigen::VectorXd offsets, std::vector<std::vector<int>> members, Edges edges, double r,
             Vector centre, double size, std::shared_ptr<const Beside> beside);
    Vector support(const Vector &m) const override;
    Feature feature_at(const Vector &p, const Vector &m) const override;
    std::optional<Face> face(const Vector &m, double aligned) const override;
    Corners corners(const Vector &m, const Turn &turn) const override;
    std::optional<Face> farthest_face(const Solid &other, const Pose &X) const override;
    const Exposed *exposed() const override { return beside_ ? &beside_->get() : nullptr; }

private:
    Vector corner(int i) const { return V_.row(i).transpose(); }
    Feature feature(int i) const;
    Face side(int i) const;
    Table V_, normals_;
    Eigen::VectorXd offsets_;
    std::vector<std::vector<int>> members_;
    Edges edges_;
    double r_;
    std::shared_ptr<const Beside> beside_;
};

}  // namespace nga
