// Steps of many trees, for Python: the blocks of the kernel by their addresses, arrays for the rest.
#include "crowd_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <vector>

#include "crowd.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Given = std::optional<Numbers>;
using Made = nb::ndarray<nb::numpy, double, nb::ndim<1>>;

Vector copy(const Numbers &x) { return Eigen::Map<const Vector>(x.data(), x.size()); }

double *block(std::size_t address) { return reinterpret_cast<double *>(address); }

Made array(const Vector &x) {
    double *data = new double[x.size() + 1];
    std::copy(x.data(), x.data() + x.size(), data);
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    return {data, {static_cast<std::size_t>(x.size())}, owner};
}

nb::tuple evaluate(Crowd &crowd, int subset, std::size_t step, std::size_t iterate, std::size_t rows, const Numbers &q,
                   const Given &tau, const Given &K, const Given &D) {
    TreeLoads loads;
    if (tau) loads = {tau->data(), K->data(), D->data()};
    const Vector start = copy(q);
    double error = 0.0;
    {
        nb::gil_scoped_release release;
        error = crowd.evaluate(subset, block(step), block(iterate), block(rows), start, loads);
    }
    return nb::make_tuple(error, array(crowd.configuration()));
}

// Values, rows and starts of the columns of the Newton matrix, and its right side.
nb::tuple linear(Crowd &crowd, int subset, std::size_t step, std::size_t iterate, std::size_t rows) {
    Crowd::Linear *found = nullptr;
    {
        nb::gil_scoped_release release;
        found = new Crowd::Linear(crowd.linear(subset, block(step), block(iterate), block(rows)));
    }
    nb::capsule owner(found, [](void *p) noexcept { delete static_cast<Crowd::Linear *>(p); });
    using Indices = nb::ndarray<nb::numpy, int, nb::ndim<1>>;
    return nb::make_tuple(Made(found->values.data(), {found->values.size()}, owner),
                          Indices(found->rows.data(), {found->rows.size()}, owner),
                          Indices(found->starts.data(), {found->starts.size()}, owner),
                          Made(found->right.data(), {static_cast<std::size_t>(found->right.size())}, owner));
}

void advance(Crowd &crowd, int subset, std::size_t step, std::size_t iterate, std::size_t rows, const Numbers &z,
             std::size_t next) {
    crowd.advance(subset, block(step), block(iterate), block(rows), copy(z), block(next));
}

Made round(Crowd &crowd, int subset, std::size_t step, std::size_t iterate, std::size_t rows, std::size_t next,
           std::size_t contacts) {
    Vector sets = Vector::Zero(5 * contacts);
    {
        nb::gil_scoped_release release;
        crowd.round(subset, block(step), block(iterate), block(rows), block(next), sets.data());
    }
    return array(sets);
}

}  // namespace

void bind_crowd(nb::module_ &m) {
    nb::class_<Crowd>(m, "Crowd")
        .def("__init__", [](Crowd *self, const std::string &model, std::vector<double> reach,
                            bool flat) { new (self) Crowd(model, std::move(reach), flat); })
        .def("add",
             [](Crowd &self, std::size_t plan, const std::vector<int> &bodies) {
                 return self.add(*reinterpret_cast<const kernel::Plan *>(plan), bodies);
             })
        .def("rebound", [](Crowd &self, int subset, std::size_t step, const Numbers &q,
                           const Numbers &v) { self.rebound(subset, block(step), copy(q), copy(v)); })
        .def("evaluate", &evaluate, nb::arg("subset"), nb::arg("step"), nb::arg("iterate"), nb::arg("rows"),
             nb::arg("q"), nb::arg("tau").none(), nb::arg("K").none(), nb::arg("D").none())
        .def("response", [](Crowd &self, int subset, std::size_t step,
                            std::size_t rows) { return array(self.response(subset, block(step), block(rows))); })
        .def("linear", &linear)
        .def("advance", &advance)
        .def("round", &round)
        .def("with_forces",
             [](Crowd &self, int subset, std::size_t step, std::size_t iterate, std::size_t rows, const Numbers &kappa,
                const Numbers &P, const Numbers &la, std::size_t next) {
                 self.with_forces(subset, block(step), block(iterate), block(rows), copy(kappa), copy(P), copy(la), block(next));
             })
        .def_ro("evaluations", &Crowd::evaluations)
        .def_ro("corrections", &Crowd::corrections)
        .def_ro("rounds", &Crowd::rounds)
        .def_ro("problems", &Crowd::problems)
        .def_ro("inner", &Crowd::inner);
}

}  // namespace nga
