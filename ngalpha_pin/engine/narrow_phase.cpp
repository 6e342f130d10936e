// Where two shapes touch or are about to: the pairs of features that a step works with.
//
// coal finds the nearest points; where shapes touch, its normal is not exact, so that they are moved apart along the
// normal of the step before. The normal picks the features, whose kinematics need no further search. Where one side is a
// face, `resting_points` finds what of the other side may come to rest on it.
#include <algorithm>

#include "shape_pair.hpp"
#include "surface.hpp"

namespace nga {
namespace {

// shapes closer than this part of the smaller one are moved apart by it before coal looks for the normal
constexpr double APART = 1e-2;
constexpr double SETTLED = 1 - 1e-12;  // cosine between the normals of two looks that agree
constexpr int LOOKS = 6;
// cosine of the angle by which coal's normal may be off: somewhat above sqrt(2 tolerance / distance), 3e-4 for shapes of
// 0.2 m that are moved apart
constexpr double NEARLY = 1 - 5e-7;
// sine of the angle between straight sides that count as parallel; sharp edges that cross touch in one point, beside
// which their ends are no contacts
constexpr double PARALLEL = 0.03, PARALLEL_EDGES = 1e-4;

using Faces = std::pair<std::optional<Face>, std::optional<Face>>;

// One look at a pair: its pose, the turn of the step on both sides, and what carries a force.
struct Look {
    const ShapePair &pair;
    const Pose &X;
    Pose back;
    Turn turn_a, turn_b;
    const std::vector<Row> &carry;

    std::vector<Row> on_faces(const Faces &faces) const;
    std::vector<Row> on_face_of_a(const Face &on) const;
    std::vector<Row> on_face_of_b(const Face &face) const;
    std::vector<Row> of_edges(const Feature &f_a, const Feature &f_b, Vector n, const Nearest &near) const;
    std::vector<Row> parallel(const Feature &f_a, const Feature &f_b, const Vector &n, const Nearest &near) const;
    Faces flush(const Vector &n) const;
    bool in_pieces() const { return pair.a->exposed() || pair.b->exposed(); }
};

// The flat side of a shape above a face that it is near to, if that is a disc.
std::optional<Face> disc_above(const Solid &solid, const Vector &m, const Pose &at) {
    if (!dynamic_cast<const Turned *>(&solid)) return std::nullopt;
    const std::optional<Face> found = solid.face(at.R.transpose() * m, STANDS);
    return found ? std::optional<Face>(moved(*found, at)) : std::nullopt;
}

std::vector<Row> Look::on_face_of_a(const Face &on) const {
    std::vector<Row> found;
    std::vector<Vector> kept;
    for (const Row &row : carry) kept.push_back(X.act(row.place(SIDE)));
    Corners corners = pair.b->corners(-(X.R.transpose() * on.normal), turn_b);
    for (Corner &x : corners) x = x.moved(X);
    const Felt felt = surface_test(on, {*pair.a, Pose()}, {*pair.b, X});
    for (const Corner &x : resting_points(on, corners, disc_above(*pair.b, -on.normal, X), kept, felt))
        found.emplace_back(on.feature, moved(x.feature(), back), on.normal);
    return found;
}

std::vector<Row> Look::on_face_of_b(const Face &face) const {
    std::vector<Row> found;
    std::vector<Vector> kept;
    const Face on = moved(face, X);
    for (const Row &row : carry) kept.push_back(row.place(0));
    const Corners corners = pair.a->corners(-on.normal, turn_a);
    const Felt felt = surface_test(on, {*pair.b, X}, {*pair.a, Pose()});
    for (const Corner &x : resting_points(on, corners, disc_above(*pair.a, -on.normal, Pose()), kept, felt))
        found.emplace_back(x.feature(), face.feature, -on.normal);
    return found;
}

// What of one shape rests on a face of the other: on that of A if there is something, but a disc on what is none, whose
// rim then has points of its own.
std::vector<Row> Look::on_faces(const Faces &faces) const {
    const auto &[of_a, of_b] = faces;
    const bool turned = of_a && of_b && of_a->radius > 0.0 && of_b->radius == 0.0;
    std::vector<Row> found;
    for (bool second : {turned, !turned}) {
        if (second && of_b) found = on_face_of_b(*of_b);
        if (!second && of_a) found = on_face_of_a(*of_a);
        if (!found.empty()) break;
    }
    return found;
}

// The features at the nearest points, of which neither rests on a face of the other.
std::vector<Row> Look::of_edges(const Feature &f_a, const Feature &on_b, Vector n, const Nearest &near) const {
    Feature f_b = on_b;
    const double sharp = f_a.r == 0.0 && f_b.r == 0.0 ? PARALLEL_EDGES : PARALLEL;
    if (f_a.flat() == 1 && f_b.flat() == 1) {
        const Vector across = f_a.E.col(0).cross(X.R * f_b.E.col(0));
        const double sine = across.norm();
        if (sine < sharp) return parallel(f_a, f_b, n, near);
        n = across / std::copysign(sine, across.dot(n));  // coal's normal is nearly that of the two lines
    }
    if (f_a.flat() + f_b.flat() > 2) {  // beside a face, an edge or another face has no point of its own
        if (in_pieces()) return {};
        f_b.c = X.act_inverse(near.on_b), f_b.E.setZero();
    }
    return {Row(f_a, f_b, n)};
}

double from_line(const Vector &x, const Vector &through, const Vector &e) {
    const Vector away = x - through;
    return (away - away.dot(e) * e).norm();
}

// Two straight sides along each other: the ends of what they share, as points of B against the line of A.
std::vector<Row> Look::parallel(const Feature &f_a, const Feature &f_b, const Vector &n, const Nearest &near) const {
    const Vector e = f_a.E.col(0), e_b = X.R * f_b.E.col(0);
    const double on = ON * pair.size();
    double low_a = INFINITY, high_a = -INFINITY, low_b = INFINITY, high_b = -INFINITY;
    // a box that stands beside an edge offers all corners of its face
    for (const Corner &x : pair.a->corners(n, turn_a)) {
        const Vector p = x.support(n);
        if (from_line(p, near.on_a, e) < on) low_a = std::min(low_a, p.dot(e)), high_a = std::max(high_a, p.dot(e));
    }
    Corner low{}, high{};
    for (const Corner &corner : pair.b->corners(-(X.R.transpose() * n), turn_b)) {
        const Corner x = corner.moved(X);
        const Vector p = x.support(-n);
        if (!(from_line(p, near.on_b, e_b) < on)) continue;
        if (p.dot(e) < low_b) low_b = p.dot(e), low = x;
        if (p.dot(e) > high_b) high_b = p.dot(e), high = x;
    }
    const double first = std::max(low_a, low_b), last = std::min(high_a, high_b), width = high_b - low_b;
    if (!(last > first && width > 0.0)) {
        Feature f = f_b;
        f.E.setZero();
        return {Row(f_a, f, n)};
    }
    std::vector<Row> found;
    for (double end : {first, last})
        found.emplace_back(f_a, between(low, high, (end - low_b) / width, -n).moved(back).feature(), n);
    return found;
}

// Two faces so nearly parallel that coal's normal may be anywhere between theirs; the one that keeps them apart.
Faces Look::flush(const Vector &n) const {
    std::optional<Face> on_a = pair.a->face(n, NEARLY), on_b = pair.b->face(-(X.R.transpose() * n), NEARLY);
    if (!on_a || !on_b) return {};
    if (pair.separation(X, on_a->normal) < pair.separation(X, -(X.R * on_b->normal))) return {std::nullopt, on_b};
    return {on_a, on_b};
}

// The face of a shape in a direction, or that of the feature at the nearest point.
std::optional<Face> face_of(const Solid &solid, const Vector &m, const Feature &f) {
    std::optional<Face> found = solid.face(m);
    if (!found && f.flat() == 2) found = solid.face(f.E.col(0).cross(f.E.col(1)));
    return found;
}

}  // namespace

double ShapePair::separation(const Pose &X, const Vector &n) const {
    return n.dot(X.act(b->support(-(X.R.transpose() * n))) - a->support(n));
}

Nearest ShapePair::nearest(const Pose &X, const Vector *hint) const {
    Nearest found = distance(X);
    const double s = APART * size();
    if (dynamic_cast<const Wall *>(a.get()) || found.distance > s) return found;
    if (hint != nullptr) {
        found.normal = *hint;
    } else if (std::abs(found.distance) < 1e-6 * size() || !found.normal.allFinite()) {
        found.normal = X.act(b->centre) - a->centre;
        found.normal /= std::max(found.normal.norm(), TINY);
    }
    for (int i = 0; i < LOOKS; ++i) {
        const Vector before = found.normal;
        found = distance({X.R, X.p + s * before});
        found.on_b -= s * before;
        if (found.normal.dot(before) > SETTLED) break;
    }
    return found;
}

std::vector<Row> ShapePair::features(const Pose &X, const Turn &turn, const std::vector<Row> &before,
                                     const std::vector<Row> &carry) const {
    const Look look{*this, X, X.inverse(), turn, turn ? Turn(X.R.transpose() * *turn) : Turn(), carry};
    const Vector hint = before.empty() ? Vector::Zero() : before[0].normal();
    const Nearest near = nearest(X, before.empty() ? nullptr : &hint);
    const Vector &n = near.normal, m = -(X.R.transpose() * n);
    const Feature f_a = a->feature_at(near.on_a, n), f_b = b->feature_at(look.back.act(near.on_b), m);
    Faces faces{face_of(*a, n, f_a), face_of(*b, m, f_b)};
    if (!faces.first && !faces.second) faces = look.flush(n);
    std::vector<Row> found = look.on_faces(faces);
    if (!found.empty()) return found;
    found = look.of_edges(f_a, f_b, n, near);
    if (!look.in_pieces()) return found;
    const auto is_none = [&](const Row &row) { return !row_is_surface(*a, *b, X, row); };
    found.erase(std::remove_if(found.begin(), found.end(), is_none), found.end());
    if (!found.empty()) return found;
    return look.on_faces({a->farthest_face(*b, X), b->farthest_face(*a, look.back)});
}

}  // namespace nga
