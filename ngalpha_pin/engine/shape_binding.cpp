// Solids and pairs of them, for Python.
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "collision_arrays.hpp"
#include "collision_binding.hpp"
#include "shape_pair.hpp"

namespace nga {
namespace {

struct CoalShape {
    std::shared_ptr<coal::CollisionGeometry> shape;
};

using Members = std::vector<std::vector<int>>;
using Bools = std::vector<bool>;

std::shared_ptr<Exposed> exposed_of(double tol, double near, const Numbers &V, const Bools &faces, const Bools &corners,
                                    const std::vector<Numbers> &parts, const std::vector<Numbers> &blocked) {
    auto found = std::make_shared<Exposed>();
    found->tol = tol, found->near = near, found->V = vectors_of(V);
    found->faces.assign(faces.begin(), faces.end()), found->corners.assign(corners.begin(), corners.end());
    const std::vector<Vector> first = vectors_of(parts.at(0)), way = vectors_of(parts.at(1));
    const std::vector<Vector> low = vectors_of(parts.at(2)), high = vectors_of(parts.at(3));
    for (std::size_t i = 0; i < first.size(); ++i) found->parts.push_back({first[i], way[i], low[i], high[i]});
    for (const Numbers &ways : blocked) found->blocked.push_back(vectors_of(ways));
    return found;
}

// What a function of Python's finds where it is asked for; null without one.
std::shared_ptr<const Beside> beside_of(const nb::object &find) {
    if (find.is_none()) return nullptr;
    return std::make_shared<Beside>([find]() -> Beside::Found {
        const nb::gil_scoped_acquire python;
        return nb::cast<std::shared_ptr<Exposed>>(find());
    });
}

std::shared_ptr<Solid> polytope(const Numbers &V, const Numbers &normals, const Numbers &offsets, Members members,
                                const std::vector<int> &edges, double r, const Numbers &centre, double size,
                                const nb::object &beside) {
    using Rows = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>;
    using Fours = Eigen::Map<const Eigen::Matrix<int, Eigen::Dynamic, 4, Eigen::RowMajor>>;
    const Eigen::Index n = V.size() / 3, faces = offsets.size(), sides = edges.size() / 4;
    return std::make_shared<Polytope>(Rows(V.data(), n, 3), Rows(normals.data(), faces, 3),
                                      Eigen::Map<const Eigen::VectorXd>(offsets.data(), faces), std::move(members),
                                      Fours(edges.data(), sides, 4), r, vector_of(centre), size, beside_of(beside));
}

Pose pose(const Numbers &R, const Numbers &p) { return {matrix_of(R), vector_of(p)}; }

nb::tuple tuple(const Nearest &found) {
    return nb::make_tuple(found.distance, array(found.normal), array(found.on_a), array(found.on_b));
}

}  // namespace

void bind_shapes(nb::module_ &m) {
    nb::class_<Exposed>(m, "Exposed")
        .def_static("of", &exposed_of)
        .def("felt", [](const Exposed &self, const Numbers &p, const Numbers &n) { return self.felt(vector_of(p), vector_of(n)); });
    nb::class_<CoalShape>(m, "CoalShape")
        .def_static("of", [](const std::string &kind, const std::vector<double> &numbers, double swept) {
            return CoalShape{shape_for_coal(kind, numbers, swept)};
        })
        .def_static("hull", [](const Numbers &points, const std::vector<std::vector<unsigned>> &around, double swept) {
            return CoalShape{hull_for_coal(vectors_of(points), around, swept)};
        });
    nb::class_<Solid>(m, "Solid")
        .def_static("round", [](const Numbers &centre, const Numbers &half, const Numbers &Q, double r, double size) {
            return std::shared_ptr<Solid>(std::make_shared<Round>(vector_of(centre), vector_of(half), matrix_of(Q), r, size));
        })
        .def_static("turned", [](const Numbers &ends, const Numbers &axis, double first, double second, double r,
                                 const Numbers &centre, double size) {
            const std::vector<Vector> at = vectors_of(ends);
            return std::shared_ptr<Solid>(std::make_shared<Turned>(at.at(0), at.at(1), vector_of(axis), first, second, r,
                                                                   vector_of(centre), size));
        })
        .def_static("wall", [](const Numbers &normal, const Numbers &centre, bool two_sided) {
            return std::shared_ptr<Solid>(std::make_shared<Wall>(vector_of(normal), vector_of(centre), two_sided));
        })
        .def_static("polytope", &polytope, nb::arg("V"), nb::arg("normals"), nb::arg("offsets"), nb::arg("members"),
                    nb::arg("edges"), nb::arg("r"), nb::arg("centre"), nb::arg("size"), nb::arg("beside").none())
        .def("support", [](const Solid &self, const Numbers &n) { return array(self.support(vector_of(n))); })
        .def("corners", [](const Solid &self, const Numbers &n, const nb::object &turn) {
            std::vector<double> found;
            for (const Corner &x : self.corners(vector_of(n), turn_of(turn)))
                found.insert(found.end(), x.c.data(), x.c.data() + 3);
            return array(found.data(), found.size(), 3);
        }, nb::arg("m"), nb::arg("turn").none())
        // the points, at most four and those at `kept`, with which corners of a shape rest on a face of this one
        .def("resting", [](const Solid &self, const Numbers &n, const Solid &other, const Numbers &kept) {
            const auto on = self.face(vector_of(n));
            std::vector<double> found;
            if (!on) return array(nullptr, 0, 3);
            for (const Corner &x : resting_points(*on, other.corners(-on->normal, std::nullopt), std::nullopt, vectors_of(kept), {}))
                found.insert(found.end(), x.c.data(), x.c.data() + 3);
            return array(found.data(), found.size(), 3);
        });
    nb::class_<ShapePair>(m, "ShapePair")
        .def("__init__", [](ShapePair *self, std::shared_ptr<Solid> a, std::shared_ptr<Solid> b, const CoalShape *of_a,
                            const CoalShape *of_b, const Numbers &R_a, const Numbers &p_a, const Numbers &R_b, const Numbers &p_b) {
            new (self) ShapePair{std::move(a), std::move(b), of_a ? of_a->shape : nullptr, of_b ? of_b->shape : nullptr,
                                 pose(R_a, p_a), pose(R_b, p_b)};
        }, nb::arg("a"), nb::arg("b"), nb::arg("shape_a").none(), nb::arg("shape_b").none(), nb::arg("R_a"), nb::arg("p_a"),
            nb::arg("R_b"), nb::arg("p_b"))
        .def("distance", [](const ShapePair &self, const Numbers &R, const Numbers &p) { return tuple(self.distance(pose(R, p))); })
        .def("nearest", [](const ShapePair &self, const Numbers &R, const Numbers &p) { return tuple(self.nearest(pose(R, p), nullptr)); })
        .def("separation", [](const ShapePair &self, const Numbers &R, const Numbers &p, const Numbers &n) {
            return self.separation(pose(R, p), vector_of(n));
        })
        // normals from A to B of the features with which a pair that overlaps touches, and of the faces of pieces
        .def("normals", [](const ShapePair &self, const Numbers &R, const Numbers &p) {
            const Pose X = pose(R, p);
            std::vector<double> found;
            const auto add = [&](const Vector &n) { found.insert(found.end(), n.data(), n.data() + 3); };
            for (const Row &row : self.features(X, std::nullopt, {}, {})) add(row.normal());
            if (const auto on = self.a->farthest_face(*self.b, X)) add(on->normal);
            if (const auto on = self.b->farthest_face(*self.a, X.inverse())) add(-(X.R * on->normal));
            return array(found.data(), found.size(), 3);
        })
        .def("features", [](const ShapePair &self, const Numbers &R, const Numbers &p, const nb::object &turn,
                            const Numbers &before, const Numbers &carry) {
            return array(self.features(pose(R, p), turn_of(turn), rows_of(before), rows_of(carry)));
        }, nb::arg("R"), nb::arg("p"), nb::arg("turn").none(), nb::arg("before"), nb::arg("carry"));
}

}  // namespace nga
