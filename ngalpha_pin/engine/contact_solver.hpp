// Solves one frictional contact problem of many bodies, from a guess or from nothing.
//
// Semi-smooth Newton with exact cones from the guess; where it stalls, from what some Gauss-Seidel sweeps make of it, in
// proximal rounds from there where it was a guess, from points on the central path, and at last in proximal rounds.
#pragma once
#include <vector>

#include "contact_problem.hpp"
#include "interior_point.hpp"

namespace nga {

// What a solution took.
struct Work {
    int corrections = 0, sweeps = 0, path = 0, rounds = 0;
    double error = 0.0;  // largest residual, relative to the largest percussion, both in units of sqrt(energy)
    bool solved = false;
};

template <int N>
class ContactSolver {
public:
    ContactSolver() : interior_(trees_) {}

    // P: first guess, then the solution, or where the search for it has ended.
    Work solve(const Problem &problem, Vector &P, double tolerance);

private:
    bool newton(Vector &P, const Held &held, double tolerance, int corrections, Work &work);
    void sweep(Vector &P, int count, Work &work);
    bool follow_path(const Problem &problem, Vector &P, double tolerance, Work &work);
    bool proximal(Vector &P, double tolerance, Work &work);
    Measure linearise_all(const Vector &P, const Held &held);

    TreeOperator<N> trees_;
    InteriorPoint<N> interior_;
    std::vector<Response> responses_;
    Vector y_, dP_, dy_, trial_, near_, centre_;
};

}  // namespace nga
