// Numbers of common/tolerances.py.
#pragma once

namespace nga {

constexpr double TINY = 1e-300, ROUNDING = 64 * 2.220446049250313e-16;

}  // namespace nga
