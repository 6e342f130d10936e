// The contact problem of one level, for Python.
#include "level_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "level_problem.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Wholes = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using ByRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Eigen::VectorXd copy(const Numbers &x) { return Eigen::Map<const Eigen::VectorXd>(x.data(), x.size()); }

// P, whether it is found (None where there is no friction and Newton's method is not for the problem), and the sweeps.
nb::tuple solve(const Table &G, const Numbers &b, const Numbers &mu, const Wholes &of_F, const Numbers &lower,
                const Numbers &upper, const Numbers &guess, double tol, int max_sweeps, bool patient) {
    const Eigen::Map<const ByRows> matrix(G.data(), G.shape(0), G.shape(1));
    LevelProblem problem(matrix, copy(b), copy(mu), {of_F.data(), of_F.data() + of_F.size()}, copy(lower), copy(upper));
    Eigen::VectorXd P = copy(guess);
    const auto [end, sweeps] = problem.solve(P, tol, max_sweeps, patient);
    double *data = new double[P.size() + 1];
    std::copy(P.data(), P.data() + P.size(), data);
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    const nb::ndarray<nb::numpy, double> found(data, {static_cast<std::size_t>(P.size())}, owner);
    if (end == LevelProblem::End::convex) return nb::make_tuple(found, nb::none(), sweeps);
    return nb::make_tuple(found, end == LevelProblem::End::converged, sweeps);
}

}  // namespace

void bind_level_problem(nb::module_ &m) {
    m.def("solve_level", &solve, nb::arg("G"), nb::arg("b"), nb::arg("mu"), nb::arg("of_F"), nb::arg("lower"),
          nb::arg("upper"), nb::arg("guess"), nb::arg("tol"), nb::arg("max_sweeps"), nb::arg("patient"));
}

}  // namespace nga
