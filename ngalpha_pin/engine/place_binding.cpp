// Pairs that are near and the places of their features, for Python.
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "collision_arrays.hpp"
#include "collision_binding.hpp"
#include "places.hpp"

namespace nga {
namespace {

using Rows = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Taken = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Lists = std::vector<std::vector<double>>;

std::shared_ptr<NearPairs> near_pairs(const std::vector<const ShapePair *> &shapes, std::vector<int> a, std::vector<int> b,
                                      const std::vector<Numbers> &points, const Lists &numbers,
                                      const std::vector<bool> &two_sided, double typical) {
    auto found = std::make_shared<Pairs>();
    for (const ShapePair *shape : shapes) found->shapes.push_back(*shape);
    found->a = std::move(a), found->b = std::move(b);
    found->centres_a = vectors_of(points.at(0)), found->centres_b = vectors_of(points.at(1));
    found->walls = vectors_of(points.at(2));
    found->size_b = numbers.at(0), found->radii = numbers.at(1), found->doubt = numbers.at(2), found->extent = numbers.at(3);
    found->two_sided.assign(two_sided.begin(), two_sided.end());
    found->typical = typical;
    return std::make_shared<NearPairs>(found);
}

std::vector<const double *> pointers(const std::vector<std::size_t> &addresses) {
    std::vector<const double *> found;
    for (std::size_t x : addresses) found.push_back(reinterpret_cast<const double *>(x));
    return found;
}

}  // namespace

void bind_places(nb::module_ &m) {
    using Addresses = std::vector<std::size_t>;
    nb::class_<Bodies>(m, "Bodies").def("__init__", [](Bodies *self, const Addresses &R, const Addresses &p,
                                                       const Addresses &v, const Addresses &w) {
        new (self) Bodies{pointers(R), pointers(p), pointers(v), pointers(w)};
    });
    nb::class_<NearPairs>(m, "NearPairs")
        .def_static("of", &near_pairs)
        .def("fresh", [](const NearPairs &self) { return std::make_shared<NearPairs>(self.shared()); })
        .def("within", &NearPairs::within, nb::call_guard<nb::gil_scoped_release>())
        .def("bounds", [](const NearPairs &self, const Bodies &bodies, const std::vector<int> &among, const std::vector<double> &reach) {
            std::vector<int> found;
            std::vector<double> lower;
            self.bounds(bodies, among, reach, found, lower);
            return nb::make_tuple(found, lower);
        })
        .def("look", &NearPairs::look)
        .def("speeds", [](const NearPairs &self, const Bodies &bodies, const std::vector<int> &pairs) {
            std::vector<double> found;
            for (int i : pairs) found.push_back(self.speed(bodies, i));
            return found;
        })
        .def("forget", [](NearPairs &self) { self.seen = false; })
        .def_ro("seen", &NearPairs::seen)
        .def_ro("looks", &NearPairs::looks);
    nb::class_<Places>(m, "Places")
        .def(nb::init<std::shared_ptr<NearPairs>>())
        .def("load", [](Places &self, const Bodies &bodies, const Numbers &contents, const std::vector<int> &carries,
                        double dt, double within, const Rows &packed, const Taken &loaded, const Numbers &mobility) {
            const int n = static_cast<int>(contents.size() / (1 + WIDTH));
            const Table table{packed.data(), loaded.data(), mobility.data()};
            nb::gil_scoped_release release;
            self.load(bodies, contents.data(), n, carries, dt, within, table);
        })
        .def("add_missing", [](Places &self, const Bodies &bodies, const Numbers &normals, double tol, const Rows &packed,
                               const Taken &loaded, const Numbers &mobility) {
            const Table table{packed.data(), loaded.data(), mobility.data()};
            if (3 * std::count(loaded.data(), loaded.data() + loaded.size(), true) != static_cast<long>(normals.size()))
                throw std::invalid_argument("every place that is taken has a normal");
            nb::gil_scoped_release release;
            return self.add_missing(bodies, normals.data(), tol, table);
        })
        .def("features", [](Places &self, int i, const Numbers &R, const Numbers &p, const nb::object &turn,
                            const Numbers &before, const Numbers &carry, const Numbers &mobility) {
            const Pose X{matrix_of(R), vector_of(p)};
            return array(self.features(i, X, turn_of(turn), rows_of(before), rows_of(carry), mobility.data()));
        }, nb::arg("i"), nb::arg("R"), nb::arg("p"), nb::arg("turn").none(), nb::arg("before"), nb::arg("carry"), nb::arg("mobility"))
        .def_ro("looks", &Places::looks);
    m.attr("SLOTS") = SLOTS;
    m.attr("TOUCH_STEPS") = TOUCH_STEPS;
    m.def("gap_along_normal", [](const Numbers &row, const Numbers &R, const Numbers &p) {
        return gap_along_normal(Row(row.data()), {matrix_of(R), vector_of(p)});
    });
    m.def("apart", [](const Numbers &a, const Numbers &b, const Numbers &R, const Numbers &p) {
        const std::vector<Row> one = rows_of(a), two = rows_of(b);
        const Pose X{matrix_of(R), vector_of(p)};
        std::vector<double> found;
        for (const Row &x : one)
            for (const Row &y : two) found.push_back(apart(x, y, X));
        return array(found.data(), found.size(), two.size());
    });
}

}  // namespace nga
