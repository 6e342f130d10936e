#pragma once
#include <nanobind/nanobind.h>

namespace nga {

void bind_shapes(nanobind::module_ &m);
void bind_places(nanobind::module_ &m);

}  // namespace nga
