#include "crowd.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace nga {
namespace {

using kernel::Plan;

// from this residual nothing comes back
constexpr double LOST = 1e30;
// inverse mass of a tangent, relative to its contact, below which nothing moves along it
constexpr double IMMOVABLE = 1e-8;

void put(const std::vector<int> &at, const Vector &x, Vector &all) {
    for (std::size_t i = 0; i < at.size(); ++i) all[at[i]] = x[i];
}

}  // namespace

int Crowd::Subset::contact_rows(int i) const {
    const int *first = kernel::index_of(&plan).first_F;
    return 1 + first[i + 1] - first[i];
}

// Row of W of a contact: the normal one, then friction.
int Crowd::Subset::row(int contact, int i) const {
    return i == 0 ? contact : plan.k + kernel::index_of(&plan).first_F[contact] + i - 1;
}

Crowd::Crowd(const std::string &model, std::vector<double> reach, bool flat)
    : forest_(model), reach_(std::move(reach)), flat_(flat) {
    const int nv = forest_.nv();
    q_.setZero(forest_.nq()), tau_.assign(nv, 0.0), nothing_.assign(nv, 0.0);
    forest_.show(live_);
    live_.tau = tau_.data(), live_.reach = reach_.data(), live_.q = q_.data();
    for (auto *blocks : {&M_, &K_, &D_, &T_, &S_, &KT_, &held_, &by_M_, &by_S_, &by_held_}) blocks->resize(forest_.count());
}

int Crowd::add(const Plan &plan, const std::vector<int> &bodies) {
    auto subset = std::make_unique<Subset>();
    subset->plan = plan;
    live_.features = plan.live->features;
    for (int body : bodies) {
        subset->poses.push_back(forest_.rotation(body));
        subset->poses.push_back(forest_.translation(body));
    }
    subset->plan.live = &live_, subset->plan.poses = subset->poses.data();
    int sizes[64] = {0};
    kernel::nga_rows_sizes(&plan, sizes);
    subset->rows = 0;
    for (int size : sizes) subset->rows += size;
    const kernel::Index at = kernel::index_of(&plan);
    subset->parts = 0;
    for (int i = 0; i < plan.k; ++i) {
        std::vector<int> touched;
        if (at.limit_q[i] >= 0)
            touched = {forest_.of_dof(at.limit_dof[i])};
        else
            touched = {forest_.of_joint(bodies[at.body_b[i]]), forest_.of_joint(bodies[at.body_a[i]])};
        std::sort(touched.begin(), touched.end());
        touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
        for (int tree : touched) {
            if (tree < 0) continue;
            subset->legs.push_back({i, tree, subset->parts});
            subset->parts += subset->contact_rows(i) * static_cast<int>(forest_.trees[tree].v.size());
        }
    }
    subsets_.push_back(std::move(subset));
    return static_cast<int>(subsets_.size()) - 1;
}

Eigen::Map<const Crowd::Rows> Crowd::part(const std::vector<double> &of, const Subset &subset, const Leg &leg) const {
    return {&of[leg.at], subset.contact_rows(leg.group), static_cast<int>(forest_.trees[leg.tree].v.size())};
}

// Rows of all contacts, which the kernel stores by columns, as the parts of legs.
void Crowd::cut(const Subset &subset, const double *of_all, std::vector<double> &parts) const {
    const int l = subset.plan.k + subset.plan.m;
    parts.resize(subset.parts);
    for (const Leg &leg : subset.legs) {
        double *to = &parts[leg.at];
        for (int i = 0, rows = subset.contact_rows(leg.group); i < rows; ++i) {
            const int u = subset.row(leg.group, i);
            for (int c : forest_.trees[leg.tree].v) *to++ = of_all[static_cast<std::size_t>(c) * l + u];
        }
    }
}

// W^T of forces of all rows.
Vector Crowd::collect(const Subset &subset, const Vector &forces) const {
    Vector x = Vector::Zero(forest_.nv());
    for (const Leg &leg : subset.legs) {
        const auto W = part(W_, subset, leg);
        const std::vector<int> &at = forest_.trees[leg.tree].v;
        for (int i = 0; i < W.rows(); ++i) {
            const double force = forces[subset.row(leg.group, i)];
            for (std::size_t c = 0; c < at.size(); ++c) x[at[c]] += force * W(i, c);
        }
    }
    return x;
}

// Adds rows times x to y.
void Crowd::spread(const Subset &subset, const std::vector<double> &of, const Vector &x, Vector &y) const {
    for (const Leg &leg : subset.legs) {
        const auto W = part(of, subset, leg);
        const std::vector<int> &at = forest_.trees[leg.tree].v;
        for (int i = 0; i < W.rows(); ++i) {
            double sum = 0.0;
            for (std::size_t c = 0; c < at.size(); ++c) sum += W(i, c) * x[at[c]];
            y[subset.row(leg.group, i)] += sum;
        }
    }
}

// The product with a matrix of one block for each tree.
Vector Crowd::by(const std::vector<Matrix> &blocks, const Vector &x) const {
    Vector y(x.size()), own;
    for (int t = 0; t < forest_.count(); ++t) {
        const std::vector<int> &at = forest_.trees[t].v;
        own.resize(at.size());
        for (std::size_t i = 0; i < at.size(); ++i) own[i] = x[at[i]];
        put(at, blocks[t] * own, y);
    }
    return y;
}

// G P = W A^-1 W^T P.
Vector Crowd::across(const std::vector<Matrix> &by_A, const Subset &subset, const Vector &P) const {
    Vector y = Vector::Zero(P.size());
    spread(subset, W_, by(by_A, collect(subset, P)), y);
    return y;
}

void Crowd::rebound(int number, double *step, const Vector &q, const Vector &v) {
    Subset &subset = *subsets_.at(number);
    forest_.move(q, v), q_ = q;
    std::vector<double> rows(subset.rows, 0.0);
    kernel::nga_rebound(&subset.plan, step, rows.data());
}

double Crowd::evaluate(int number, double *step, double *iterate, double *rows, const Vector &q,
                       const TreeLoads &loads) {
    ++evaluations;
    Subset &subset = *subsets_.at(number);
    const Plan &plan = subset.plan;
    const int nv = plan.nv, k = plan.k, j = k + plan.m;
    const kernel::Step s = kernel::step_of(&plan, step);
    kernel::Iterate it = kernel::iterate_of(&plan, iterate);
    kernel::Rows r = kernel::rows_of(&plan, rows);
    q0_ = q, dq_ = Eigen::Map<const Vector>(it.dq, nv);
    forest_.integrate(q0_, dq_, q_);
    forest_.dynamics(q_, Eigen::Map<const Vector>(it.v, nv), Eigen::Map<const Vector>(it.x, nv));
    loaded_ = loads.tau != nullptr;
    residual_ = forest_.residual;
    if (loaded_) residual_ -= Eigen::Map<const Vector>(loads.tau, nv);
    for (int t = 0; t < forest_.count(); ++t) {
        const Forest::Tree &tree = forest_.trees[t];
        M_[t] = tree.M, K_[t] = tree.K, D_[t] = tree.D, by_M_[t] = M_[t].inverse();
        for (std::size_t i = 0; loaded_ && i < tree.v.size(); ++i)
            for (std::size_t e = 0; e < tree.v.size(); ++e) {
                const std::size_t place = static_cast<std::size_t>(tree.v[i]) * nv + tree.v[e];
                K_[t](i, e) -= loads.K[place], D_[t](i, e) -= loads.D[place];
            }
    }
    kernel::find_rows(&plan, it.v, it.x, &r);
    cut(subset, r.W, W_);
    Vector kappa = Vector::Zero(j);
    kernel::find_forces(&plan, &s, &it, &r, kappa.data() + k);
    for (int i = 0; i < k; ++i) kappa[i] = it.x[3 * nv + i], r.y[i] = r.g_N[i];
    for (int u = 0; u < j; ++u) r.y[k + u] = r.rate[u] + s.start_rates[u], r.y[k + j + u] = r.acceleration[u];
    find_residuals(subset, s, it, r, kappa);
    if (s.scaled[0] == 0.0) scale(subset, s, it, r);
    kernel::find_laws(&plan, &s, &it, &r);
    kernel::find_bars(&plan, &s, &it, &r);
    const double error = kernel::find_error(&plan, &s, &r);
    return error < LOST ? error : std::numeric_limits<double>::infinity();
}

// (74), (78), (80)
void Crowd::find_residuals(const Subset &subset, const kernel::Step &, const kernel::Iterate &it, kernel::Rows &r,
                           const Vector &kappa) {
    const int nv = subset.plan.nv, k = subset.plan.k, j = k + subset.plan.m;
    const double *La = it.x + 3 * nv + k;
    Eigen::Map<Vector> R_a(r.R, nv), R_U(r.R + nv, nv), R_Q(r.R + 2 * nv, nv);
    Eigen::Map<Vector>(r.residual, nv) = residual_;
    R_a = residual_ - collect(subset, Eigen::Map<const Vector>(La + j, j));
    R_U = by(M_, Eigen::Map<const Vector>(it.x + nv, nv)) - collect(subset, Eigen::Map<const Vector>(La, j));
    R_Q = by(M_, Eigen::Map<const Vector>(it.x + 2 * nv, nv)) - collect(subset, kappa);
}

void Crowd::scale(Subset &subset, const kernel::Step &s, const kernel::Iterate &it, const kernel::Rows &r) {
    const int nv = subset.plan.nv, k = subset.plan.k;
    Vector G = Vector::Zero(k + subset.plan.m), mass(nv), stiff = Vector::Zero(nv);
    for (const Leg &leg : subset.legs) {
        const auto W = part(W_, subset, leg);
        for (int i = 0; i < W.rows(); ++i)
            G[subset.row(leg.group, i)] += W.row(i).dot(by_M_[leg.tree] * W.row(i).transpose());
    }
    for (int i = 0; i < k; ++i) {  // where the bodies cannot move along a tangent, its scale is that of the contact
        double largest = G[i];
        const int rows = subset.contact_rows(i);
        for (int e = 1; e < rows; ++e) largest = std::max(largest, G[subset.row(i, e)]);
        for (int e = 1; e < rows; ++e) G[subset.row(i, e)] = std::max(G[subset.row(i, e)], IMMOVABLE * largest);
    }
    const Vector h = residual_ - by(M_, Eigen::Map<const Vector>(it.x, nv));
    for (int t = 0; t < forest_.count(); ++t) {
        const std::vector<int> &at = forest_.trees[t].v;
        put(at, M_[t].diagonal(), mass);
        for (std::size_t i = 0; loaded_ && i < at.size(); ++i)
            for (std::size_t e = 0; e < at.size(); ++e) stiff[at[i]] += std::abs(K_[t](i, e)) * s.span[at[e]];
    }
    kernel::put_scales(&subset.plan, &s, &it, &r, G.data(), mass.data(), h.data(), stiff.data());
}

}  // namespace nga
