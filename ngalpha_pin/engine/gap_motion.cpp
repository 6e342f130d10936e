#include "gap_motion.hpp"

#include <algorithm>
#include <cmath>

namespace nga {

double GapMotion::most(const double *dq, const std::vector<double> &reach) const {
    const auto of_body = [&](int body) {
        double sum = 0.0;
        for (int i = 0; i < nv; ++i)
            if (support[body * nv + i] > 0.0 && dq[i] != 0.0) sum += std::abs(dq[i]) * reach[i];
        return sum;
    };
    double most = 0.0;
    for (std::size_t i = 0; i < bodies_a.size(); ++i) most = std::max(most, of_body(bodies_a[i]) + of_body(bodies_b[i]));
    for (std::size_t i = 0; i < limits.size(); ++i) most = std::max(most, std::abs(dq[limits[i]]) * measure[i]);
    return most;
}

}  // namespace nga
