// The internal forces of a cable: straight segments between nodes that carry tension and no compression, with viscous
// forces of Kelvin and Voigt that do not push either.
#pragma once
#include <vector>

namespace nga {

class Cable {
public:
    // lengths: of the segments without force. EA: stiffness [N]. damping: [s].
    Cable(std::vector<double> lengths, double EA, double damping);

    int nodes() const { return static_cast<int>(lengths_.size()) + 1; }

    // Strain energy of the cable with its nodes at x, 3 numbers each.
    double energy(const double *x) const;
    // Power of the viscous forces, not positive.
    double damping_power(const double *x, const double *v) const;
    // Tension of each segment.
    void tensions(const double *x, const double *v, double *to) const;
    // Subtracts the internal forces from tau (3 a node) and their derivatives by q and v from K and D, by columns with
    // `stride` numbers each.
    void subtract(const double *x, const double *v, double *tau, double *K, double *D, int stride) const;

private:
    struct Segment;
    Segment segment(int i, const double *x, const double *v) const;

    std::vector<double> lengths_;
    double EA_, damping_;
};

}  // namespace nga
