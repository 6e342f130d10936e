// Forces of the contacts that are closed, of one level: those that slip in known directions, and those that may stick.
#pragma once
#include <vector>

#include "level_problem.hpp"

namespace nga {

// Rows and laws, see `LevelProblem`.
struct Level {
    Eigen::MatrixXd G;
    Eigen::VectorXd b, mu;
    std::vector<int> of_F;
    Eigen::VectorXd lower, upper;
};

struct Answer {
    Eigen::VectorXd P;
    LevelProblem::End end;
};

// See `forces_of_closed_contacts`; no guess is an empty one.
Answer closed_forces(const Level &level, const std::vector<char> &closed, const Eigen::VectorXd &slip,
                     const Eigen::VectorXd &guess, double tol, int max_sweeps, bool patient);

// See `_forces` of step/linearised_round.py.
Answer held_forces(Level level, const std::vector<char> &touches, const Eigen::VectorXd &slip,
                   const Eigen::VectorXd &guess, std::vector<char> slips, double tol, int max_sweeps, bool patient);

}  // namespace nga
