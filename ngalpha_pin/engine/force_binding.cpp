// Force laws, for Python.
#include "force_binding.hpp"

#include <nanobind/stl/vector.h>

#include "force_laws.hpp"
#include "plain_steps.hpp"
#include "rod.hpp"

namespace nb = nanobind;

namespace nga {

void bind_force_laws(nb::module_ &m) {
    nb::class_<ForceLaws>(m, "ForceLaws")
        .def("__init__",
             [](ForceLaws *self, const PlainSteps &steps, std::vector<double> before) {
                 new (self) ForceLaws(steps.live(), steps.mechanism(), std::move(before));
             },
             nb::keep_alive<1, 2>())
        .def("add_joint_spring", &ForceLaws::add_joint_spring)
        .def("add_pose_spring", &ForceLaws::add_pose_spring)
        .def("add_spring", &ForceLaws::add_spring)
        .def("add_wrench", &ForceLaws::add_wrench)
        .def("add_rod", &ForceLaws::add_rod)
        .def("add_cable", &ForceLaws::add_cable)
        .def("set", &ForceLaws::set);
}

}  // namespace nga
