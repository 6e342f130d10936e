#pragma once
#include <nanobind/nanobind.h>

namespace nga {
void bind_beams(nanobind::module_ &m);
}
