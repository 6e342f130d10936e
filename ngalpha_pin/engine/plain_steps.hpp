// Steps in which nothing happens, one after the other without Python: Newton's method converges from the last forces, and
// no contact closes. Everything else is for the caller, who finds the state as it was before such a step.
#pragma once
#include <Eigen/Core>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "gap_motion.hpp"
#include "mechanism.hpp"
#include "near_pairs.hpp"

namespace nga {

// Joints between frames: the arrays of a `FrameTable`, see `Frames` of kernel.h.
struct Ties {
    int kb = 0;                                                                     // rows of g, which come first
    std::vector<int> kind, a, b, group;                                             // of each row
    std::vector<double> vector_a, point_a, point_b, vector_b, length, support;
    std::vector<int> joints;                                                        // that a and b are places in
    double unit = 0.0, vanishes = 0.0;
    std::vector<int> first_part, part, first_power;  // of couplings of joints, which come after those of g
    std::vector<double> factor, power, turn, rows;
    std::vector<int> follows;  // of each row the place of what it follows over time, -1 where that is nothing
};

// What a scene fixes.
struct Fixed {
    std::vector<double> reach;           // bound of the change of any gap per unit of each coordinate [m or 1]
    double length;                       // size of the scene [m]
    std::vector<int> lengths, angles;    // places in q of positions and of angles
    std::vector<char> slides;            // of each velocity coordinate: it is one of a length
    bool contacts;                       // there are any in the scene
    bool flat;                           // the derivative of `integrate` is the identity
    Ties ties;                           // none, or all constraints of the scene
    GapMotion motion;                    // where there are pairs of solids
    Beams beams;                         // of the scene, or none
};

// Puts value, rate and acceleration of what rows of constraints follow at a time where it is told, three numbers each.
using Follows = std::function<void(double, double *)>;

// What is the same in all steps of a run.
struct Course {
    std::vector<double> numbers;  // the first entries of the block of a step (STEP_FIELDS of kernel.h, up to `flat`)
    int max_iter;
    bool loaded, bounces;         // there are forces; some contact has restitution
    int again;                    // open contacts that may be looked at before all are looked through once more
    double relaxed;               // motion, in parts of the clearance, below which that is done
    bool divides;                 // a step in which a slip ends is divided there
    double ahead;                 // pairs of solids stay as they are where they are further apart than they approach in
                                  // so much time [s]
    const NearPairs *near;        // these pairs, or null
    Follows follows;              // of the constraints, or none
};

// Puts the generalized force at (t, q, v) and its derivatives by q and v, by columns, where it is told.
using Loads = std::function<void(double, const Eigen::VectorXd &, const Eigen::VectorXd &, double *, double *, double *)>;

class ForceLaws;

// Servos tau = kp (rest - q) - kd v of coordinates that are plain numbers, with what is held beside them, within limits,
// damping and the force laws of the engine outside of them; in place of `Loads` where a scene has nothing else.
struct Servos {
    std::vector<std::vector<double>> kp, kd, rest;  // of each servo law, by velocity coordinate
    std::vector<int> place;                         // in q of each velocity coordinate; -1 where no servo acts
    std::vector<double> held, lower, upper, damping;  // by velocity coordinate, or empty
    const ForceLaws *laws = nullptr;                // that act where the bodies are, if there are any

    void operator()(double t, const Eigen::VectorXd &q, const Eigen::VectorXd &v, double *tau, double *K, double *D) const;
};

// A state between steps; of each contact and friction row la and its auxiliary variable, normal entries first, the same
// of joints with dry friction, and la of each row of constraints.
struct Moment {
    double t, clearance;
    Eigen::VectorXd q, v, a, a_bar, la, la_bar, tau_f, tau_f_bar, la_b;
};

// How Newton's method has ended.
struct Newton {
    int iterations = 0;
    bool solved = false;
    bool refused = false;             // friction has a direction in which nothing moves
    bool dependent = false;           // directions were, and the last iterate is the one before that correction
    std::map<std::string, int> seen;  // index sets, as the bytes of `holds`, and how often they were there
};

class PlainSteps {
public:
    PlainSteps(const std::string &model, Fixed fixed);

    // Takes a subset of the contacts, whose blocks stay with the caller; returns its number.
    int add(const kernel::Plan &plan, const std::vector<int> &bodies);

    // Numbers of one step in the record, in this order: t, clearance, iterations, error, q, v, a, a_bar, la, La, P, la_bar,
    // tau, percussion and auxiliary variable of joint friction, La and la of the constraints, and for each contact whether it has kept some force.
    int width(int subset) const;

    // Up to n steps with the contacts of a subset; `near` is the subset that is looked at for new ones, -1 where it is the
    // same one, and open_near says which of its contacts are not in the first. `done` counts them, also where a function
    // of the forces throws.
    void run(int subset, int near, const std::vector<char> &open_near, const Course &course, const Loads &loads,
             Moment &moment, int n, double *record, int &done);

    // Where the bodies are, and what is computed of them, at the last evaluation.
    const kernel::Live &live() const { return live_; }
    const Mechanism &mechanism() const { return mechanism_; }
    void place(const Eigen::VectorXd &q, const Eigen::VectorXd &v) { mechanism_.dynamics(q, v, Eigen::VectorXd::Zero(v.size())); }

    // One step in one piece with the contacts of a subset, `near` and open_near as above: a row of the record, the places
    // of the contacts in `near` that close in it with their gaps, and how far it has moved gaps; see attempt.cpp.
    Newton attempt(int subset, int near, const std::vector<char> &open_near, const Course &course, const Loads &loads,
                   const Moment &moment, double growth, std::vector<double> &record, std::vector<int> &closing,
                   std::vector<double> &gaps, double &spent);

    // Newton's method (143) on the equations of a step that the caller has set up and evaluated once: `step` is their
    // block, and `iterate` the block of the first iterate, which becomes the last one. `growth` is that of the residual at
    // which it gives up, infinity for never; with `all_derivatives` see differenced.cpp.
    Newton solve(int subset, const Loads &loads, const Follows &follows, double t, const Eigen::VectorXd &q,
                 const double *step, double *iterate, int max_iter, double growth, bool all_derivatives);

    // So far: plain steps that were done, attempts and those that were solved, evaluations of the equations, and corrections.
    long steps = 0, attempts = 0, solved = 0, evaluations = 0, corrections = 0;

private:
    struct Subset {
        kernel::Plan plan;
        std::vector<const double *> poses;
        int step, iterate, rows;
    };
    Subset &prepared(int subset);
    void start(Subset &subset, const Moment &moment);
    Newton newton(Subset &subset, const Loads &loads, const Moment &moment, int max_iter,
                  double growth = std::numeric_limits<double>::infinity(), bool all_derivatives = false);
    void tie();
    void begin(Subset &subset, const Course &course, const Moment &moment);
    bool circles(const kernel::Plan &plan, Newton &found);
    bool still(const Subset &subset) const;
    double evaluate(Subset &subset, const Loads &loads, const Moment &moment);
    void load(const Loads &loads, double t);
    bool correct(Subset &subset, const Moment &moment);
    bool correct_by_differences(Subset &subset, const Loads &loads, const Moment &moment);
    void shift(Subset &subset, const Loads &loads, const Moment &moment, Eigen::MatrixXd &R_Q, Eigen::MatrixXd &y_Q);
    bool closes(Subset *near, const std::vector<char> &open_near);
    bool ends_slip(const Subset &subset, const Moment &moment);
    void keep(Subset &subset, Moment &moment, int iterations, double *record);
    void find_span(const Eigen::VectorXd &q, double *span) const;

    Fixed fixed_;
    Mechanism mechanism_;
    kernel::Live live_{};
    kernel::Frames frames_{};
    std::vector<const double *> tied_;
    std::vector<std::unique_ptr<Subset>> subsets_;
    std::vector<double> work_, step_, iterate_, next_, rows_, gaps_, tau_, K_, D_, wanted_;
    Eigen::VectorXd q_, v_, a_, dq_;
    double error_ = 0.0;
};

}  // namespace nga
