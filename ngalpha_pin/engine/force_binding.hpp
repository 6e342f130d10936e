#pragma once
#include <nanobind/nanobind.h>

namespace nga {
void bind_force_laws(nanobind::module_ &m);
}
