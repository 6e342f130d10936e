// The contacts between shapes whose touching features change: a fixed number of places for every pair; see
// collision/manifold.py.
#pragma once
#include <memory>
#include <algorithm>
#include <vector>

#include "near_pairs.hpp"

namespace nga {

constexpr int SLOTS = 12;            // of every pair
constexpr double TOUCH_STEPS = 3.0;  // shapes nearer than this many times the motion of one step get their features

// Arrays that stay with the caller: packed rows of all places, and which are taken; and of every pair the Gram matrix of
// the ways of B relative to A, in the axes of A.
struct Table {
    double *packed;
    bool *loaded;
    const double *mobility;

    Row row(int place) const { return Row(packed + WIDTH * place); }
    void put(int place, const Row &row) const;
};

class Places {
public:
    explicit Places(std::shared_ptr<NearPairs> near) : near_(std::move(near)), chosen_(near_->pairs().n()), added_(SLOTS * near_->pairs().n()) {}

    // Fill empty places at the start of a step with the features of the pairs that may touch in it.
    //   contents: what was in the places in the step before, numbers and rows
    //   carries: places whose contacts carry a force, or have just done so
    //   dt: length of the step [s]; NaN for corners that are fixed points
    //   within: pairs have features from this distance, even where they are at rest [m]
    void load(const Bodies &bodies, const double *contents, int n, const std::vector<int> &carries, double dt,
              double within, const Table &table);

    // Look whether a pair penetrates with features that are in no place, and add them; the places that they have got. Where
    // all are taken, an open one is given away that has been added since the step began: a point that runs around a rim in
    // a step leaves one behind in every look.
    //   normals: present ones of the places that are taken, in order, in the world, by rows
    //   tol: penetration that is none [m]
    std::vector<int> add_missing(const Bodies &bodies, const double *normals, double tol, const Table &table);

    // Features with which a pair may touch, without those whose gap no motion of the mechanism changes. They are a
    // function of the arguments; the last answer is kept for bodies that do not move.
    const std::vector<Row> &features(int i, const Pose &X, const Turn &turn, const std::vector<Row> &before,
                                     const std::vector<Row> &carry, const double *mobility);

    long looks = 0;  // answers that were not kept

private:
    // A place for one more feature of a pair, or -1.
    int place_for_more(int pair, const Pose &X, const Table &table) const;
    struct Chosen {
        std::vector<double> asked;
        std::vector<Row> rows;
    };
    std::shared_ptr<NearPairs> near_;
    std::vector<Chosen> chosen_;
    std::vector<char> added_;  // places that the step has not begun with
};

// How far features are from each other, on the side where they are nearer and that is no face; infinite between features
// of different normals [m].
double apart(const Row &a, const Row &b, const Pose &X);

}  // namespace nga
