// Beams, for Python.
#include "beam_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>
#include <vector>

#include "beams.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

template <int dimensions>
using Array = nb::ndarray<const double, nb::ndim<dimensions>, nb::c_contig, nb::device::cpu>;
using Made = nb::ndarray<nb::numpy, double, nb::f_contig>;

Made made(std::vector<double> *data, std::vector<std::size_t> shape) {
    nb::capsule owner(data, [](void *p) noexcept { delete static_cast<std::vector<double> *>(p); });
    return {data->data(), shape.size(), shape.data(), owner, {}, nb::dtype<double>(), 0, 0, 'F'};
}

// Forces (n,), and stiffness and damping in bands of LAPACK (2 w + 1, n); see `PlanarBeam.internal_forces`.
nb::tuple internal_forces(const Array<3> &first, const Array<3> &second, const Array<3> &stiffness, const Array<3> &reference,
                          double damping, const Array<1> &q, const Array<1> &v) {
    const std::size_t e = first.shape(0), g = first.shape(1), p = first.shape(2);
    const BeamSection beam{static_cast<int>(e), static_cast<int>(g), static_cast<int>(p), first.data(), second.data(),
                           stiffness.data(), reference.data(), damping};
    const std::size_t n = beam.size(), w = 2 * p - 1, rows = 2 * w + 1;
    if (second.size() != first.size() || stiffness.size() != 2 * e * g || reference.size() != 2 * e * g || q.size() != n ||
        v.size() != n)
        throw std::invalid_argument("the arrays of a beam do not fit each other");
    auto *f = new std::vector<double>(n), *K = new std::vector<double>(rows * n), *D = new std::vector<double>(rows * n);
    // entry (i, j) of a band is at [w + i - j + j rows]
    add_internal_forces(beam, q.data(), v.data(), f->data(), K->data() + w, D->data() + w, 2 * w);
    return nb::make_tuple(made(f, {n}), made(K, {rows, n}), made(D, {rows, n}));
}

}  // namespace

void bind_beams(nb::module_ &m) {
    using Numbers = std::vector<double>;
    nb::class_<BeamTable>(m, "BeamTable")
        .def("__init__", [](BeamTable *self, int elements, int gauss, int functions, Numbers first, Numbers second,
                            Numbers stiffness, Numbers reference, double damping, Numbers M) {
            new (self) BeamTable{elements, gauss, functions, std::move(first), std::move(second), std::move(stiffness),
                                 std::move(reference), damping, std::move(M)};
        });
    nb::class_<Beams>(m, "Beams")
        .def(nb::init<>())
        .def("__init__", [](Beams *self, const std::vector<const BeamTable *> &beams, std::vector<int> first,
                            std::vector<int> functions, Numbers N, Numbers dN, Numbers load, Numbers moments) {
            std::vector<BeamTable> tables;
            for (const BeamTable *table : beams) tables.push_back(*table);
            new (self) Beams(std::move(tables), {std::move(first), std::move(functions), std::move(N), std::move(dN)},
                             std::move(load), std::move(moments));
        });
    m.def("internal_forces", &internal_forces);
}

}  // namespace nga
