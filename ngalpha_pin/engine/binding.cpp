// What Python sees of the engine.
#include <coal/config.hh>
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>

#include <Eigen/Core>
#include <map>
#include <pinocchio/config.hpp>
#include <string>

#include "beam_binding.hpp"
#include "collision_binding.hpp"
#include "contact_binding.hpp"
#include "crowd_binding.hpp"
#include "force_binding.hpp"
#include "level_binding.hpp"
#include "plain_binding.hpp"
#include "strand_binding.hpp"

namespace nb = nanobind;

namespace {

#if defined(__clang__)
constexpr const char *COMPILER = "clang " __clang_version__;
#else
constexpr const char *COMPILER = "g++ " __VERSION__;
#endif

std::map<std::string, std::string> versions() {
    const std::string eigen = std::to_string(EIGEN_WORLD_VERSION) + '.' + std::to_string(EIGEN_MAJOR_VERSION) + '.' +
                              std::to_string(EIGEN_MINOR_VERSION);
    return {{"compiler", COMPILER}, {"pinocchio", PINOCCHIO_VERSION}, {"coal", COAL_VERSION}, {"eigen", eigen}};
}

}  // namespace

NB_MODULE(_engine, m) {
    nb::set_leak_warnings(false);  // what a script still holds when it ends is no fault of its user
    m.def("versions", &versions);
    nga::bind_beams(m);
    nga::bind_contact_solver(m);
    nga::bind_crowd(m);
    nga::bind_strands(m);
    nga::bind_shapes(m);
    nga::bind_places(m);
    nga::bind_force_laws(m);
    nga::bind_level_problem(m);
    nga::bind_plain_steps(m);
}
