#pragma once
#include <nanobind/nanobind.h>

namespace nga {

void bind_contact_solver(nanobind::module_ &m);

}  // namespace nga
