// Plain steps, for Python: arrays in, arrays out, and a function of Python's for the forces where there are any.
#include "plain_binding.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "force_laws.hpp"
#include "plain_steps.hpp"

namespace nb = nanobind;

namespace nga {
namespace {

using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Made = nb::ndarray<nb::numpy, double>;

Eigen::VectorXd copy(const Numbers &x) { return Eigen::Map<const Eigen::VectorXd>(x.data(), x.size()); }

Made array(const double *from, std::vector<std::size_t> shape) {
    std::size_t size = 1;
    for (std::size_t n : shape) size *= n;
    double *data = new double[size + 1];
    std::copy(from, from + size, data);
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    return {data, shape.size(), shape.data(), owner};
}

// The generalized force from a function of Python's that gives it with its derivatives, by rows.
Loads loads_of(const nb::object &function) {
    return [function](double t, const Eigen::VectorXd &q, const Eigen::VectorXd &v, double *tau, double *K, double *D) {
        const std::size_t nq = q.size(), nv = v.size();
        const nb::tuple found = nb::cast<nb::tuple>(function(t, array(q.data(), {nq}), array(v.data(), {nv})));
        const auto force = nb::cast<Numbers>(found[0]);
        const auto by_q = nb::cast<Table>(found[1]), by_v = nb::cast<Table>(found[2]);
        if (force.size() != nv || by_q.size() != nv * nv || by_v.size() != nv * nv)
            throw std::invalid_argument("the forces of a scene have another size than its velocities");
        std::copy(force.data(), force.data() + nv, tau);
        for (std::size_t i = 0; i < nv; ++i)
            for (std::size_t l = 0; l < nv; ++l)
                K[l * nv + i] = by_q.data()[i * nv + l], D[l * nv + i] = by_v.data()[i * nv + l];
    };
}

// What rows of constraints follow, from a function of Python's that gives it at a time; none where it is None.
Follows follows_of(const nb::object &function) {
    if (function.is_none()) return {};
    return [function](double t, double *wanted) {
        nb::gil_scoped_acquire locked;
        const auto found = nb::cast<Numbers>(function(t));
        std::copy(found.data(), found.data() + found.size(), wanted);
    };
}

Fixed fixed_of(std::vector<double> reach, double length, std::vector<int> lengths, std::vector<int> angles,
               const std::vector<bool> &slides, bool contacts, bool flat, const Ties &ties, const GapMotion &motion,
               const Beams &beams) {
    return {std::move(reach), length, std::move(lengths), std::move(angles), {slides.begin(), slides.end()}, contacts, flat,
            ties, motion, beams};
}

Made run(PlainSteps &steps, int subset, int near, const std::vector<bool> &open_near, std::vector<double> numbers,
         int max_iter, bool bounces, int again, double relaxed, bool divides, double ahead, const NearPairs *near_pairs, const nb::object &forces, const nb::object &follows, double t, double clearance,
         const Numbers &q, const Numbers &v, const Numbers &a, const Numbers &a_bar, const Numbers &la,
         const Numbers &la_bar, const Numbers &tau_f, const Numbers &tau_f_bar, const Numbers &la_b, int n) {
    const Course course{std::move(numbers), max_iter, !forces.is_none(), bounces, again, relaxed, divides, ahead, near_pairs, follows_of(follows)};
    const bool native = nb::isinstance<Servos>(forces);
    const Loads loads = forces.is_none() ? Loads() : native ? Loads(nb::cast<Servos>(forces)) : loads_of(forces);
    Moment moment{t, clearance, copy(q), copy(v), copy(a), copy(a_bar), copy(la), copy(la_bar), copy(tau_f), copy(tau_f_bar), copy(la_b)};
    const std::size_t width = steps.width(subset);
    std::vector<double> record(width * n);
    const std::vector<char> open(open_near.begin(), open_near.end());
    int done = 0;
    try {
        std::optional<nb::gil_scoped_release> release;
        if (!course.loaded || native) release.emplace();
        steps.run(subset, near, open, course, loads, moment, n, record.data(), done);
    } catch (nb::python_error &error) {  // what was done is kept: the function fails again in the next call
        if (done == 0) throw;
        if (error.matches(PyExc_KeyboardInterrupt)) PyErr_SetInterrupt();
    }
    return array(record.data(), {static_cast<std::size_t>(done), width});
}

// Force and derivatives by q and v of laws that need no Python.
nb::tuple loads_at(PlainSteps &steps, const Servos &laws, double t, const Numbers &q, const Numbers &v) {
    const std::size_t nv = v.size();
    std::vector<double> tau(nv), K(nv * nv), D(nv * nv);
    steps.place(copy(q), copy(v));
    laws(t, copy(q), copy(v), tau.data(), K.data(), D.data());
    const auto square = [nv](std::vector<double> &A) {
        Eigen::Map<Eigen::MatrixXd>(A.data(), nv, nv).transposeInPlace();
        return array(A.data(), {nv, nv});
    };
    return nb::make_tuple(array(tau.data(), {nv}), square(K), square(D));
}

nb::object attempt(PlainSteps &steps, int subset, int near, const std::vector<bool> &open_near,
                   std::vector<double> numbers, int max_iter, double growth, bool bounces, const nb::object &forces,
                   const nb::object &follows, double t,
                   const Numbers &q, const Numbers &v, const Numbers &a, const Numbers &a_bar, const Numbers &la,
                   const Numbers &la_bar, const Numbers &tau_f, const Numbers &tau_f_bar, const Numbers &la_b) {
    Course course{};
    course.numbers = std::move(numbers), course.max_iter = max_iter, course.loaded = !forces.is_none();
    course.bounces = bounces, course.follows = follows_of(follows);
    const bool native = nb::isinstance<Servos>(forces);
    const Loads loads = forces.is_none() ? Loads() : native ? Loads(nb::cast<Servos>(forces)) : loads_of(forces);
    const Moment moment{t, 0.0, copy(q), copy(v), copy(a), copy(a_bar), copy(la), copy(la_bar), copy(tau_f), copy(tau_f_bar), copy(la_b)};
    std::vector<double> record, gaps;
    std::vector<int> closing;
    double spent = 0.0;
    Newton found;
    {
        std::optional<nb::gil_scoped_release> release;
        if (!course.loaded || native) release.emplace();
        const std::vector<char> open(open_near.begin(), open_near.end());
        found = steps.attempt(subset, near, open, course, loads, moment, growth, record, closing, gaps, spent);
    }
    if (!found.solved) return nb::none();
    return nb::make_tuple(array(record.data(), {1, record.size()}), closing, array(gaps.data(), {gaps.size()}), spent);
}

nb::tuple solve(PlainSteps &steps, int subset, const nb::object &forces, const nb::object &follows, double t,
                const Numbers &q, std::size_t step, std::size_t iterate, int max_iter, double growth, bool all_derivatives) {
    const bool native = nb::isinstance<Servos>(forces);
    const Loads loads = forces.is_none() ? Loads() : native ? Loads(nb::cast<Servos>(forces)) : loads_of(forces);
    const Follows wanted = follows_of(follows);
    const Eigen::VectorXd start = copy(q);
    Newton found;
    {
        std::optional<nb::gil_scoped_release> release;
        if (!loads || native) release.emplace();
        found = steps.solve(subset, loads, wanted, t, start, reinterpret_cast<const double *>(step),
                            reinterpret_cast<double *>(iterate), max_iter, growth, all_derivatives);
    }
    nb::dict seen;
    for (const auto &[sets, times] : found.seen) seen[nb::bytes(sets.data(), sets.size())] = times;
    return nb::make_tuple(found.iterations, found.solved, found.dependent, seen);
}

}  // namespace

void bind_plain_steps(nb::module_ &m) {
    using Laws = std::vector<std::vector<double>>;
    nb::class_<Servos>(m, "Servos")
        .def("__init__",
             [](Servos *self, Laws kp, Laws kd, Laws rest, std::vector<int> place, std::vector<double> held,
                std::vector<double> lower, std::vector<double> upper, std::vector<double> damping, const ForceLaws *laws) {
                 new (self) Servos{std::move(kp),    std::move(kd),    std::move(rest),    std::move(place), std::move(held),
                                   std::move(lower), std::move(upper), std::move(damping), laws};
             },
             nb::arg("kp"), nb::arg("kd"), nb::arg("rest"), nb::arg("place"), nb::arg("held"), nb::arg("lower"),
             nb::arg("upper"), nb::arg("damping"), nb::arg("laws").none(), nb::keep_alive<1, 10>());
    using Places = std::vector<std::vector<int>>;
    nb::class_<Ties>(m, "Ties").def(nb::init<>()).def(
        "__init__", [](Ties *self, int kb, const Places &p, const Laws &x, std::vector<int> joints, double unit,
                        double vanishes, const Places &c, const Laws &y, std::vector<int> follows) {
            new (self) Ties{kb,      p.at(0), p.at(1), p.at(2), p.at(3), x.at(0), x.at(1), x.at(2), x.at(3), x.at(4), x.at(5),
                            std::move(joints), unit, vanishes, c.at(0), c.at(1), c.at(2), y.at(0), y.at(1), y.at(2), y.at(3),
                            std::move(follows)};
        });
    nb::class_<GapMotion>(m, "GapMotion")
        .def(nb::init<>())
        .def("__init__", [](GapMotion *self, std::vector<double> support, const std::vector<std::vector<int>> &of_points,
                            std::vector<double> measure, int nv) {
            new (self) GapMotion{std::move(support), of_points.at(0), of_points.at(1), of_points.at(2), std::move(measure), nv};
        });
    nb::class_<PlainSteps>(m, "PlainSteps")
        .def("__init__",
             [](PlainSteps *self, const std::string &model, std::vector<double> reach, double length,
                std::vector<int> lengths, std::vector<int> angles, const std::vector<bool> &slides, bool contacts,
                bool flat, const Ties &ties, const GapMotion &motion, const Beams &beams) {
                 new (self) PlainSteps(model, fixed_of(std::move(reach), length, std::move(lengths), std::move(angles),
                                                       slides, contacts, flat, ties, motion, beams));
             })
        .def("add",
             [](PlainSteps &self, std::size_t plan, const std::vector<int> &bodies) {
                 return self.add(*reinterpret_cast<const kernel::Plan *>(plan), bodies);
             })
        .def("run", &run, nb::arg("subset"), nb::arg("near"), nb::arg("open_near"), nb::arg("numbers"),
             nb::arg("max_iter"), nb::arg("bounces"), nb::arg("again"), nb::arg("relaxed"), nb::arg("divides"), nb::arg("ahead"), nb::arg("near_pairs").none(), nb::arg("forces").none(),
             nb::arg("follows").none(), nb::arg("t"), nb::arg("clearance"), nb::arg("q"), nb::arg("v"), nb::arg("a"), nb::arg("a_bar"),
             nb::arg("la"), nb::arg("la_bar"), nb::arg("tau_f"), nb::arg("tau_f_bar"), nb::arg("la_b"), nb::arg("n"))
        .def("loads", &loads_at)
        .def("attempt", &attempt, nb::arg("subset"), nb::arg("near"), nb::arg("open_near"), nb::arg("numbers"),
             nb::arg("max_iter"), nb::arg("growth"), nb::arg("bounces"), nb::arg("forces").none(), nb::arg("follows").none(),
             nb::arg("t"), nb::arg("q"), nb::arg("v"), nb::arg("a"), nb::arg("a_bar"), nb::arg("la"), nb::arg("la_bar"),
             nb::arg("tau_f"), nb::arg("tau_f_bar"), nb::arg("la_b"))
        .def("solve", &solve, nb::arg("subset"), nb::arg("forces").none(), nb::arg("follows").none(), nb::arg("t"), nb::arg("q"), nb::arg("step"),
             nb::arg("iterate"), nb::arg("max_iter"), nb::arg("growth"), nb::arg("all_derivatives"))
        .def_ro("steps", &PlainSteps::steps)
        .def_ro("attempts", &PlainSteps::attempts)
        .def_ro("solved", &PlainSteps::solved)
        .def_ro("evaluations", &PlainSteps::evaluations)
        .def_ro("corrections", &PlainSteps::corrections);
}

}  // namespace nga
