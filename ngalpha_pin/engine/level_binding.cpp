// The contact problem of one level, for Python.
#include "level_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "level_forces.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Wholes = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using ByRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Eigen::VectorXd copy(const Numbers &x) { return Eigen::Map<const Eigen::VectorXd>(x.data(), x.size()); }

using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

std::vector<char> flags(const Flags &x) { return {x.data(), x.data() + x.size()}; }

// P and whether it is found: None where there is no friction and Newton's method is not for the problem.
nb::tuple told(const Eigen::VectorXd &P, LevelProblem::End end) {
    double *data = new double[P.size() + 1];
    std::copy(P.data(), P.data() + P.size(), data);
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    const nb::ndarray<nb::numpy, double> found(data, {static_cast<std::size_t>(P.size())}, owner);
    if (end == LevelProblem::End::convex) return nb::make_tuple(found, nb::none());
    return nb::make_tuple(found, end == LevelProblem::End::converged);
}

Level level_of(const Table &G, const Numbers &b, const Numbers &mu, const Wholes &of_F, const Numbers &lower,
               const Numbers &upper) {
    const Eigen::Map<const ByRows> matrix(G.data(), G.shape(0), G.shape(1));
    return {matrix, copy(b), copy(mu), {of_F.data(), of_F.data() + of_F.size()}, copy(lower), copy(upper)};
}

nb::tuple solve(const Table &G, const Numbers &b, const Numbers &mu, const Wholes &of_F, const Numbers &lower,
                const Numbers &upper, const Numbers &guess, double tol, int max_sweeps, bool patient) {
    Level level = level_of(G, b, mu, of_F, lower, upper);
    LevelProblem problem(std::move(level.G), level.b, level.mu, level.of_F, level.lower, level.upper);
    Eigen::VectorXd P = copy(guess);
    const auto [end, sweeps] = problem.solve(P, tol, max_sweeps, patient);
    return nb::make_tuple(told(P, end), sweeps);
}

nb::tuple held(const Table &G, const Numbers &b, const Numbers &mu, const Wholes &of_F, const Numbers &lower,
               const Numbers &upper, const Flags &touches, const Numbers &slip, const Numbers &guess,
               const Flags &slips, double tol, int max_sweeps, bool patient) {
    const Answer found = held_forces(level_of(G, b, mu, of_F, lower, upper), flags(touches), copy(slip), copy(guess),
                                     flags(slips), tol, max_sweeps, patient);
    return told(found.P, found.end);
}

}  // namespace

void bind_level_problem(nb::module_ &m) {
    m.def("held_forces", &held, nb::arg("G"), nb::arg("b"), nb::arg("mu"), nb::arg("of_F"), nb::arg("lower"),
          nb::arg("upper"), nb::arg("touches"), nb::arg("slip"), nb::arg("guess"), nb::arg("slips"), nb::arg("tol"),
          nb::arg("max_sweeps"), nb::arg("patient"));
    m.def("solve_level", &solve, nb::arg("G"), nb::arg("b"), nb::arg("mu"), nb::arg("of_F"), nb::arg("lower"),
          nb::arg("upper"), nb::arg("guess"), nb::arg("tol"), nb::arg("max_sweeps"), nb::arg("patient"));
}

}  // namespace nga
