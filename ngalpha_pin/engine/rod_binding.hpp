#pragma once
#include <nanobind/nanobind.h>

namespace nga {
void bind_rods(nanobind::module_ &m);
}
