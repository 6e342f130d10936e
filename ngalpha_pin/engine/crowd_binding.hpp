#pragma once
#include <nanobind/nanobind.h>

namespace nga {
void bind_crowd(nanobind::module_ &m);
}
