// Signorini's and Coulomb's laws of one contact, and bounded rows, as equations r(P, y) = 0 and their linearisations.
#pragma once
#include <Eigen/Core>
#include <vector>

namespace nga {

// rows of a group at most: a normal one, two of sliding and one of drilling friction (Contensou)
constexpr int MOST_ROWS = 4;

enum class Kind : char {
    contact,  // 0 <= P_N _|_ y_N >= 0 (41), y_F in the normal cone of the ball of radius mu P_N at -P_F (47)
    tied,     // the same normal law, and friction P_F = mu P_N direction, whatever y_F is (120)
    bounded,  // one row: lower <= P <= upper, y = 0 between them; without bounds it is bilateral
};

// Rows that one law ties together.
struct Group {
    Kind kind = Kind::contact;
    int first = 0, rows = 1;  // place in P and y
    double mu = 0.0, lower = 0.0, upper = 0.0;
    double direction[MOST_ROWS - 1] = {0.0, 0.0, 0.0};
    double s_N = 1.0, s_F = 1.0;  // inverse masses of the normal row and of friction [1/kg]
};

// How the percussions of a group answer to y: dP = p - C dy.
struct Response {
    double C[MOST_ROWS][MOST_ROWS];
    double p[MOST_ROWS];
};

// A problem that is held near the percussions Z with the inverse mass hold * s, and what keeps its Jacobian regular.
struct Held {
    const double *Z = nullptr;
    double hold = 0.0, regular = 0.0;
};

// Largest residual and largest percussion so far, both in units of sqrt(energy).
struct Measure {
    double residual = 0.0, size = 1e-300;
    double error() const { return residual / size; }
};

// Residual of the laws of a group at (P, y), added to `measure`; fills in the Newton step and returns which case holds.
char linearise(const Group &group, const double *P, const double *y, const Held &held, Response &response,
               Measure &measure);

// Percussions of a group after one prox step (131), (137), with G the block of the group, by rows of MOST_ROWS.
void prox_step(const Group &group, const double *G, const double *y, double *P);

}  // namespace nga
