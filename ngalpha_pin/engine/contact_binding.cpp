// The contact solver, for Python: arrays in, arrays out.
#include "contact_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>

#include "contact_solver.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const int, nb::c_contig, nb::device::cpu>;

void check(bool fine, const char *what) {
    if (!fine) throw nb::value_error((std::string("contact problem: ") + what).c_str());
}

std::vector<double> copy(const Numbers &x) { return {x.data(), x.data() + x.size()}; }

std::vector<Group> groups_of(const Indices &kinds, const Indices &rows, const Numbers &laws) {
    check(rows.size() == kinds.size() && laws.size() == 6 * kinds.size(), "kinds, rows and laws differ in length");
    std::vector<Group> groups(kinds.size());
    int first = 0;
    for (std::size_t g = 0; g < groups.size(); ++g) {
        check(kinds.data()[g] >= 0 && kinds.data()[g] <= 2, "a kind is none of 0, 1, 2");
        groups[g].kind = static_cast<Kind>(kinds.data()[g]);
        groups[g].first = first;
        groups[g].rows = rows.data()[g];
        check(groups[g].rows >= 1 && groups[g].rows <= MOST_ROWS, "a group has no row or more than four");
        check(groups[g].kind != Kind::bounded || groups[g].rows == 1, "a bounded group has one row");
        const double *law = laws.data() + 6 * g;
        groups[g].mu = law[0];
        groups[g].lower = law[1];
        groups[g].upper = law[2];
        check(law[0] >= 0.0 && law[1] <= law[2], "a friction coefficient is negative or a lower bound above the upper");
        std::copy(law + 3, law + 6, groups[g].direction);
        first += groups[g].rows;
    }
    return groups;
}

Problem problem_of(const Indices &sizes, const Numbers &M, std::vector<Group> groups, const Indices &legs,
                   const Numbers &J, const Numbers &bias, const Numbers &compliance) {
    Problem problem;
    problem.sizes.assign(sizes.data(), sizes.data() + sizes.size());
    std::size_t entries = 0;
    for (int n : problem.sizes) {
        check(n >= 1, "a tree has no coordinates");
        entries += static_cast<std::size_t>(n) * n;
    }
    check(M.size() == entries, "M does not have the blocks of the trees");
    int last = -1, at = 0;
    for (std::size_t l = 0; l < legs.size() / 2; ++l) {
        const int group = legs.data()[2 * l], tree = legs.data()[2 * l + 1];
        check(group >= last && group >= 0 && group < static_cast<int>(groups.size()), "legs are not in the order of groups");
        check(tree >= 0 && tree < static_cast<int>(problem.sizes.size()), "a leg names no tree");
        problem.legs.push_back({group, tree, at});
        at += groups[group].rows * problem.sizes[tree];
        last = group;
    }
    check(J.size() == static_cast<std::size_t>(at), "J does not have the rows of the legs");
    const int rows = groups.empty() ? 0 : groups.back().first + groups.back().rows;
    check(bias.size() == static_cast<std::size_t>(rows), "bias does not have one number for each row");
    check(compliance.size() == 0 || compliance.size() == MOST_ROWS * MOST_ROWS * groups.size(), "compliance is not (groups, 4, 4)");
    problem.M = copy(M);
    problem.J = copy(J);
    problem.bias = copy(bias);
    problem.compliance = copy(compliance);
    problem.groups = std::move(groups);
    return problem;
}

class Solver {
public:
    std::pair<nb::ndarray<nb::numpy, double, nb::ndim<1>>, std::map<std::string, double>> solve(
        Indices sizes, Numbers M, Indices kinds, Indices rows, Numbers laws, Indices legs, Numbers J, Numbers bias,
        Numbers guess, double tolerance, Numbers compliance) {
        const Problem problem = problem_of(sizes, M, groups_of(kinds, rows, laws), legs, J, bias, compliance);
        check(guess.size() == bias.size(), "the guess does not have one number for each row");
        Vector P = Eigen::Map<const Vector>(guess.data(), guess.size());
        Work work;
        {
            nb::gil_scoped_release release;
            const bool bodies = std::all_of(problem.sizes.begin(), problem.sizes.end(), [](int n) { return n == 6; });
            work = bodies ? bodies_.solve(problem, P, tolerance) : trees_.solve(problem, P, tolerance);
        }
        double *data = new double[P.size() + 1];
        std::copy(P.data(), P.data() + P.size(), data);
        nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
        return {{data, {static_cast<std::size_t>(P.size())}, owner},
                {{"error", work.error}, {"solved", work.solved}, {"corrections", work.corrections},
                 {"sweeps", work.sweeps}, {"path", work.path}, {"rounds", work.rounds}}};
    }

private:
    ContactSolver<6> bodies_;
    ContactSolver<Eigen::Dynamic> trees_;
};

}  // namespace

void bind_contact_solver(nb::module_ &m) {
    nb::class_<Solver>(m, "ContactSolver")
        .def(nb::init<>())
        .def("solve", &Solver::solve, nb::arg("sizes"), nb::arg("M"), nb::arg("kinds"), nb::arg("rows"),
             nb::arg("laws"), nb::arg("legs"), nb::arg("J"), nb::arg("bias"), nb::arg("guess"), nb::arg("tolerance"),
             nb::arg("compliance"));
}

}  // namespace nga
