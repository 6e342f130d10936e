// Internal forces of rods and cables, for Python: arrays in, arrays out.
#include "strand_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>

#include "cable.hpp"
#include "rod.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Made = nb::ndarray<nb::numpy, double>;

// Coordinates and velocities of a node.
template <class Strand>
constexpr int NQ = 7;
template <>
constexpr int NQ<Cable> = 3;
template <class Strand>
constexpr int NV = 6;
template <>
constexpr int NV<Cable> = 3;

template <class Strand>
const double *coordinates(const Strand &strand, const Numbers &x) {
    if (x.size() != std::size_t(NQ<Strand>) * strand.nodes()) throw std::invalid_argument("other coordinates than of the nodes");
    return x.data();
}

template <class Strand>
const double *velocities(const Strand &strand, const Numbers &v) {
    if (v.size() != std::size_t(NV<Strand>) * strand.nodes()) throw std::invalid_argument("other velocities than of the nodes");
    return v.data();
}

// Internal forces off tau; derivatives off the transposes of K and D, which are square and of the same size as tau.
template <class Strand>
void subtract(const Strand &strand, const Numbers &x, const Numbers &v, Vector tau, Table K, Table D, int first) {
    const std::size_t n = tau.size(), end = first + NV<Strand> * strand.nodes();
    if (first < 0 || end > n || K.shape(0) != n || K.shape(1) != n || D.shape(0) != n || D.shape(1) != n)
        throw std::invalid_argument("the coordinates of the nodes are not among those of the forces");
    const std::size_t corner = first * (n + 1);
    strand.subtract(coordinates(strand, x), velocities(strand, v), tau.data() + first, K.data() + corner, D.data() + corner,
                    static_cast<int>(n));
}

template <class Strand>
nb::class_<Strand> bound(nb::module_ &m, const char *name) {
    return nb::class_<Strand>(m, name)
        .def("energy", [](const Strand &strand, const Numbers &x) { return strand.energy(coordinates(strand, x)); })
        .def("damping_power",
             [](const Strand &strand, const Numbers &x, const Numbers &v) {
                 return strand.damping_power(coordinates(strand, x), velocities(strand, v));
             })
        .def("subtract", &subtract<Strand>);
}

double *made(std::size_t size, nb::capsule &owner) {
    double *data = new double[size];
    owner = nb::capsule(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    return data;
}

Made section_forces(const Rod &rod, const Numbers &x, const Numbers &v) {
    const std::size_t n = 2 * rod.elements();
    nb::capsule owner;
    double *data = made(6 * n, owner);
    rod.section_forces(coordinates(rod, x), velocities(rod, v), data);
    return Made(data, {n, 6}, owner);
}

Made tensions(const Cable &cable, const Numbers &x, const Numbers &v) {
    const std::size_t n = cable.nodes() - 1;
    nb::capsule owner;
    double *data = made(n, owner);
    cable.tensions(coordinates(cable, x), velocities(cable, v), data);
    return Made(data, {n}, owner);
}

}  // namespace

void bind_strands(nb::module_ &m) {
    bound<Rod>(m, "Rod")
        .def(nb::init<std::vector<double>, std::vector<double>, const std::vector<double> &, double>())
        .def("lengths", &Rod::lengths)
        .def("gauss_places", &Rod::gauss_places)
        .def("section_forces", &section_forces);
    bound<Cable>(m, "Cable").def(nb::init<std::vector<double>, double, double>()).def("tensions", &tensions);
}

}  // namespace nga
