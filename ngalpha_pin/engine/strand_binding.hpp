#pragma once
#include <nanobind/nanobind.h>

namespace nga {
void bind_strands(nanobind::module_ &m);
}
