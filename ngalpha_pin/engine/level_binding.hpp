#pragma once
#include <nanobind/nanobind.h>

namespace nga {
void bind_level_problem(nanobind::module_ &m);
}
