#pragma once
#include <nanobind/nanobind.h>

namespace nga {
void bind_plain_steps(nanobind::module_ &m);
}
