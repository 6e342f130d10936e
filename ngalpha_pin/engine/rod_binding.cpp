// Internal forces of rods, for Python: arrays in, arrays out.
#include "rod_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>

#include "rod.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Made = nb::ndarray<nb::numpy, double>;

const double *checked(const Numbers &numbers, std::size_t n) {
    if (numbers.size() != n) throw std::invalid_argument("a rod has 7 coordinates and 6 velocities a node");
    return numbers.data();
}

const double *coordinates(const Rod &rod, const Numbers &x) { return checked(x, 7 * rod.nodes()); }
const double *velocities(const Rod &rod, const Numbers &v) { return checked(v, 6 * rod.nodes()); }

// Internal forces off tau; derivatives off the transposes of K and D, which are square and of the same size as tau.
void subtract(const Rod &rod, const Numbers &x, const Numbers &v, Vector tau, Table K, Table D, int first) {
    const std::size_t n = tau.size(), end = first + 6 * rod.nodes();
    if (first < 0 || end > n || K.shape(0) != n || K.shape(1) != n || D.shape(0) != n || D.shape(1) != n)
        throw std::invalid_argument("the coordinates of the rod are not among those of the forces");
    const std::size_t corner = first * (n + 1);
    rod.subtract(coordinates(rod, x), velocities(rod, v), tau.data() + first, K.data() + corner, D.data() + corner, static_cast<int>(n));
}

Made section_forces(const Rod &rod, const Numbers &x, const Numbers &v) {
    const std::size_t n = 2 * rod.elements();
    double *data = new double[6 * n];
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    rod.section_forces(coordinates(rod, x), velocities(rod, v), data);
    return Made(data, {n, 6}, owner);
}

}  // namespace

void bind_rods(nb::module_ &m) {
    nb::class_<Rod>(m, "Rod")
        .def(nb::init<std::vector<double>, std::vector<double>, const std::vector<double> &, double>())
        .def("lengths", &Rod::lengths)
        .def("gauss_places", &Rod::gauss_places)
        .def("energy", [](const Rod &rod, const Numbers &x) { return rod.energy(coordinates(rod, x)); })
        .def("damping_power",
             [](const Rod &rod, const Numbers &x, const Numbers &v) {
                 return rod.damping_power(coordinates(rod, x), velocities(rod, v));
             })
        .def("section_forces", &section_forces)
        .def("subtract", &subtract);
}

}  // namespace nga
