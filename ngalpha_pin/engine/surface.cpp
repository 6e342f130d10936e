#include "surface.hpp"

namespace nga {

Felt surface_test(const Face &on, const Placed &below, const Placed &above) {
    const Exposed *under = below.solid.exposed(), *upon = above.solid.exposed();
    if (under == nullptr && upon == nullptr) return {};
    const Vector n = on.normal, c = on.feature.c;
    const Pose at = below.at, to = above.at;
    return [=](const Vector &p, bool cut) {
        if (upon != nullptr && !upon->felt(to.act_inverse(p), -(to.R.transpose() * n))) return false;
        // a corner of the other one may be anywhere on the face, but what a side of the face cuts needs that side
        const Vector foot = p + n.dot(c - p) * n;
        return !cut || under == nullptr || under->felt(at.act_inverse(foot), at.R.transpose() * n);
    };
}

bool row_is_surface(const Solid &a, const Solid &b, const Pose &X, const Row &row) {
    const Vector n = row.normal(), places[] = {row.place(0), X.act(row.place(SIDE))};
    const Eigen::Matrix<double, 3, 2> E[] = {row.E(0), X.R * row.E(SIDE)};
    for (int i : {0, 1}) {
        const Solid &solid = i ? b : a;
        if (solid.exposed() == nullptr) continue;
        const Pose pose = i ? X : Pose();
        Vector p = places[i];
        const Vector direction = pose.R.transpose() * (i ? Vector(-n) : n);
        if (!E[i].col(0).isZero(0.0) && !E[i].col(1).isZero(0.0)) {
            if (!solid.face(direction)) return false;
            continue;
        }
        if (E[1 - i].isZero(0.0))  // the point of a line beside that of the other side
            p += E[i] * (E[i].transpose() * (places[1 - i] - p));
        if (!solid.exposed()->felt(pose.act_inverse(p), direction)) return false;
    }
    return true;
}

}  // namespace nga
