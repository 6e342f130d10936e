// The Newton matrix (143) of a crowd, and its correction.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "crowd.hpp"

namespace nga {
namespace {

// Derivatives of the laws of one contact by its y and, with y held, by its multipliers: normal and friction rows of
// gaps, velocities and accelerations, of which there are `full`.
class ContactDerivatives {
public:
    Eigen::MatrixXd by_y, by_forces;

    ContactDerivatives(const kernel::Plan &plan, const kernel::Step &s, const kernel::Iterate &it,
                       const kernel::Rows &r, int contact)
        : s_(s), r_(r), i_(contact), first_(kernel::index_of(&plan).first_F[contact]),
          m_(kernel::index_of(&plan).first_F[contact + 1] - first_), k_(plan.k), j_(plan.k + plan.m),
          mu_(kernel::table_of(&plan).mu[contact]), la_N_(it.z[k_ + j_ + contact]) {
        by_y = by_forces = Eigen::MatrixXd::Zero(3 + 2 * m_, 3 + 2 * m_);
        const bool moves = m_ > 0 && r.A[i_] != 0.0;
        slips_ = moves && r.stick[i_] == 0.0;
        for (int e = 0; e < 3 + 2 * m_; ++e) {
            if (r.holds[multiplier(e)] != 0.0)
                by_y(e, e) = 1.0;
            else if (!(is_P_F(e) && slips_) && !(e > m_ + 2 && moves && r.stick_a[i_] == 0.0))
                add_force(e);
        }
        if (slips_) slip();
        if (moves && r.stick_a[i_] == 0.0) slip_at_end();
    }

    // Number among all multipliers, or among all equations.
    int multiplier(int e) const {
        if (e == 0) return i_;
        const int level = e > m_ + 1, row = e - 1 - level * (m_ + 1);
        return k_ + level * j_ + (row == 0 ? i_ : k_ + first_ + row - 1);
    }

private:
    bool is_P_F(int e) const { return e > 1 && e < 2 + m_; }

    void add_force(int e) {
        by_forces(e, e) += 1.0;
        if (e == 0) by_forces(0, m_ + 2) += kernel::kappa_c(&s_, i_);
        if (e > 0 && e < m_ + 2) by_forces(e, e + m_ + 1) += s_.gamma_c[0];
    }

    // Derivative of the direction of a vector.
    Eigen::MatrixXd turned(const double *unit, double norm) const {
        Eigen::Map<const Eigen::VectorXd> u(unit + first_, m_);
        return (Eigen::MatrixXd::Identity(m_, m_) - u * u.transpose()) / norm;
    }

    void slip() {
        const double whole = s_.paper[0], gamma_c = s_.gamma_c[0];
        const int P_N = 1, P_F = 2, la_N = m_ + 2, la_F = m_ + 3;
        Eigen::Map<const Eigen::VectorXd> unit(r_.unit_v + first_, m_), along(r_.unit_c + first_, m_);
        const Eigen::MatrixXd c_y = r_.size_v[first_] * turned(r_.unit_v, r_.norm_v[first_]);  // of -c by y
        Eigen::MatrixXd c = Eigen::MatrixXd::Zero(m_, by_y.cols());
        c.col(P_N) = -mu_ * unit, c.col(la_N) = -whole * gamma_c * mu_ * unit;
        c.middleCols(la_F, m_).diagonal().array() += (1.0 - whole) * gamma_c;
        for (int e = 0; e < m_; ++e) add_force(P_F + e);
        if (r_.capped[first_] == 0.0) {
            by_y.block(P_F, P_F, m_, m_) = c_y;
            by_forces.middleRows(P_F, m_) -= c;
            return;
        }
        const Eigen::MatrixXd turn = -r_.cap[first_] * turned(r_.unit_c, r_.norm_c[first_]);
        by_y.block(P_F, P_F, m_, m_) = -turn * c_y;
        by_forces.middleRows(P_F, m_) += turn * c;
        by_forces.block(P_F, P_N, m_, 1) -= mu_ * along;
        by_forces.block(P_F, la_N, m_, 1) -= gamma_c * mu_ * along;
    }

    void slip_at_end() {
        const int P_F = 2, la_N = m_ + 2, la_F = m_ + 3;
        Eigen::Map<const Eigen::VectorXd> unit(r_.unit_a + first_, m_);
        by_y.block(la_F, slips_ ? P_F : la_F, m_, m_) = mu_ * la_N_ * turned(r_.unit_a, r_.norm_a[first_]);
        by_forces.block(la_F, la_F, m_, m_).setIdentity();
        by_forces.block(la_F, la_N, m_, 1) = mu_ * unit;
    }

    const kernel::Step &s_;
    const kernel::Rows &r_;
    int i_, first_, m_, k_, j_;
    double mu_, la_N_;
    bool slips_ = false;
};

// Derivative of kappa of a contact by its multipliers, see `find_displacements` of newton.c.
Eigen::MatrixXd displacements(const kernel::Plan &plan, const kernel::Step &s, const kernel::Rows &r, int i) {
    const int first = kernel::index_of(&plan).first_F[i], m = kernel::index_of(&plan).first_F[i + 1] - first;
    const double ratio = r.ratio[i], gamma_c = s.gamma_c[0], beta_c = s.beta_c[0];
    Eigen::MatrixXd E = Eigen::MatrixXd::Zero(1 + m, 3 + 2 * m);
    E(0, 0) = 1.0;
    for (int f = 0; f < m; ++f) {
        E(1 + f, 2 + f) = ratio;
        if (s.paper[0] != 0.0 || s.displaces[0] == 0.0 || kernel::has_carried(&s, i)) continue;
        const double share = r.share[first + f];
        E(1 + f, m + 3 + f) = ratio * gamma_c - beta_c;
        E(1 + f, 0) = share, E(1 + f, 1) = -ratio * share, E(1 + f, m + 2) = (beta_c - gamma_c * ratio) * share;
    }
    return E;
}

}  // namespace

// S = M + gamma_c D + beta_c K T by trees, and the derivatives of rates by q and of accelerations by v.
void Crowd::differentiate(const Subset &subset, const kernel::Step &s, const kernel::Rows &r) {
    if (!flat_) forest_.differentiate_step(q0_, dq_);
    for (int t = 0; t < forest_.count(); ++t) {
        T_[t] = forest_.trees[t].T;
        KT_[t] = flat_ ? K_[t] : Matrix(K_[t] * T_[t]);
        S_[t] = M_[t] + s.gamma_c[0] * D_[t] + s.beta_c[0] * KT_[t];
        by_S_[t] = S_[t].inverse();
    }
    const std::size_t size = static_cast<std::size_t>(subset.plan.k + subset.plan.m) * subset.plan.nv;
    dense_X_.resize(size), dense_Y_.resize(size);
    kernel::find_derivatives(&subset.plan, &r, dense_X_.data(), dense_Y_.data());
    cut(subset, dense_X_.data(), X_), cut(subset, dense_Y_.data(), Y_);
}

Vector Crowd::response(int number, const double *step, double *rows) {
    const Subset &subset = *subsets_.at(number);
    const int nv = subset.plan.nv, k = subset.plan.k, j = k + subset.plan.m;
    const kernel::Step s = kernel::step_of(&subset.plan, const_cast<double *>(step));
    const kernel::Rows r = kernel::rows_of(&subset.plan, rows);
    Eigen::Map<const Vector> R_a(r.R, nv), R_U(r.R + nv, nv), R_Q(r.R + 2 * nv, nv);
    differentiate(subset, s, r);
    const Vector dU = -by(by_M_, R_U), dQ = -by(by_M_, R_Q);
    const Vector da = -by(by_S_, R_a + by(D_, dU) + by(KT_, dQ));
    const Vector dv = s.gamma_c[0] * da + dU;
    Vector dq = s.beta_c[0] * da + dQ, of_g = Vector::Zero(j), of_v = of_g, of_a = of_g, y(k + 2 * j);
    if (!flat_) dq = by(T_, dq);
    spread(subset, W_, dq, of_g);
    spread(subset, W_, dv, of_v), spread(subset, X_, dq, of_v);
    spread(subset, W_, da, of_a), spread(subset, Y_, dv, of_a);
    y << of_g.head(k), of_v, of_a;
    return y;
}

// Contacts and their multipliers, in whose order the matrix is.
struct Crowd::Blocks {
    std::vector<ContactDerivatives> laws;
    std::vector<Matrix> E;   // derivative of kappa by the multipliers
    std::vector<int> first;  // multiplier of each contact
    Vector row, column;      // scales
};

Crowd::Blocks Crowd::blocks(const Subset &subset, const kernel::Step &s, const kernel::Iterate &it,
                            const kernel::Rows &r) const {
    const kernel::Plan &plan = subset.plan;
    Blocks found;
    found.first.assign(1, 0);
    const int n = plan.k + 2 * (plan.k + plan.m);
    found.row.resize(n), found.column.resize(n);
    for (int i = 0; i < plan.k; ++i) {
        found.laws.emplace_back(plan, s, it, r, i), found.E.push_back(displacements(plan, s, r, i));
        const int at = found.first[i], full = static_cast<int>(found.laws[i].by_y.rows());
        found.first.push_back(at + full);
        for (int e = 0; e < full; ++e) {
            const int u = found.laws[i].multiplier(e);
            found.column[at + e] = s.column_scale[u];
            found.row[at + e] = r.holds[u] != 0.0 ? s.row_scale[u] : 1.0 / s.column_scale[u];
        }
    }
    return found;
}

// Change of y of a contact with W^T kappa, W^T La and W^T la on a tree that it touches, one beside the other.
Crowd::Matrix Crowd::answer(const Subset &subset, const kernel::Step &s, const Leg &leg, const Matrix &C,
                            const Matrix &F) const {
    const int t = leg.tree, size = subset.contact_rows(leg.group), w = static_cast<int>(M_[t].rows());
    const auto W = part(W_, subset, leg), X = part(X_, subset, leg), Y = part(Y_, subset, leg);
    Matrix found(1 + 2 * size, 3 * w), v, q;
    const Matrix *a[3] = {&F, &C, &by_S_[t]};
    for (int e = 0; e < 3; ++e) {
        v = s.gamma_c[0] * *a[e], q = s.beta_c[0] * *a[e];
        if (e == 1) v += by_M_[t];
        if (e == 0) q += by_M_[t];
        if (!flat_) q = (T_[t] * q).eval();
        found.block(0, e * w, 1, w).noalias() = W.topRows(1) * q;
        found.block(1, e * w, size, w).noalias() = W * v + X * q;
        found.block(1 + size, e * w, size, w).noalias() = W * *a[e] + Y * v;
    }
    return found;
}

Crowd::Linear Crowd::linear(int number, double *step, double *iterate, double *rows) {
    Subset &subset = *subsets_.at(number);
    const int k = subset.plan.k;
    const kernel::Step s = kernel::step_of(&subset.plan, step);
    const kernel::Rows r = kernel::rows_of(&subset.plan, rows);
    const Vector change = response(number, step, rows);
    const Blocks own = blocks(subset, s, kernel::iterate_of(&subset.plan, iterate), r);
    std::vector<std::vector<int>> touching(forest_.count()), beside(k);
    for (std::size_t l = 0; l < subset.legs.size(); ++l) touching[subset.legs[l].tree].push_back(static_cast<int>(l));
    for (const auto &legs : touching)
        for (int a : legs)
            for (int b : legs) beside[subset.legs[a].group].push_back(subset.legs[b].group);
    Linear found;
    found.starts.assign(1, 0), found.right.resize(own.first[k]);
    for (int c = 0; c < k; ++c) {
        std::sort(beside[c].begin(), beside[c].end());
        beside[c].erase(std::unique(beside[c].begin(), beside[c].end()), beside[c].end());
        for (int column = own.first[c]; column < own.first[c + 1]; ++column) {
            for (int i : beside[c])
                for (int e = own.first[i]; e < own.first[i + 1]; ++e) found.rows.push_back(e);
            found.starts.push_back(static_cast<int>(found.rows.size()));
        }
    }
    found.values.assign(found.rows.size(), 0.0);
    const auto add = [&](int i, int c, const Matrix &block) {  // by columns, whose blocks follow each other
        int before = 0;
        for (int other : beside[c]) {
            if (other == i) break;
            before += own.first[other + 1] - own.first[other];
        }
        for (int e = 0; e < block.cols(); ++e) {
            double *to = &found.values[found.starts[own.first[c] + e] + before];
            for (int u = 0; u < block.rows(); ++u)
                to[u] += block(u, e) * own.row[own.first[i] + u] * own.column[own.first[c] + e];
        }
    };
    for (int t = 0; t < forest_.count(); ++t) {
        const int w = static_cast<int>(M_[t].rows());
        if (touching[t].empty()) continue;
        const Matrix C = -by_S_[t] * D_[t] * by_M_[t], F = -by_S_[t] * KT_[t] * by_M_[t];
        std::vector<Matrix> left, right;
        for (int l : touching[t]) {
            const int i = subset.legs[l].group, size = subset.contact_rows(i);
            const auto W = part(W_, subset, subset.legs[l]);
            left.push_back(own.laws[i].by_y * answer(subset, s, subset.legs[l], C, F));
            right.push_back(Matrix::Zero(3 * w, 1 + 2 * size));
            right.back().topRows(w) = W.transpose() * own.E[i];
            right.back().block(w, 1, w, size) = W.transpose();
            right.back().block(2 * w, 1 + size, w, size) = W.transpose();
        }
        for (std::size_t a = 0; a < left.size(); ++a)
            for (std::size_t b = 0; b < left.size(); ++b)
                add(subset.legs[touching[t][a]].group, subset.legs[touching[t][b]].group, left[a] * right[b]);
    }
    for (int i = 0; i < k; ++i) {
        const int at = own.first[i], full = own.first[i + 1] - at;
        Vector y(full), law(full);
        for (int e = 0; e < full; ++e) y[e] = change[own.laws[i].multiplier(e)], law[e] = r.R_c[own.laws[i].multiplier(e)];
        found.right.segment(at, full) = -own.row.segment(at, full).cwiseProduct(law + own.laws[i].by_y * y);
        add(i, i, own.laws[i].by_forces);
    }
    return found;
}

void Crowd::advance(int number, double *step, double *iterate, double *rows, const Vector &z, double *next) {
    ++corrections;
    Subset &subset = *subsets_.at(number);
    const kernel::Plan &plan = subset.plan;
    const int nv = plan.nv, k = plan.k, j = k + plan.m, n = k + 2 * j;
    const kernel::Step s = kernel::step_of(&plan, step);
    const kernel::Iterate it = kernel::iterate_of(&plan, iterate);
    const kernel::Rows r = kernel::rows_of(&plan, rows);
    const Blocks of = blocks(subset, s, it, r);
    Vector dz(n), kappa(j);
    for (int i = 0; i < k; ++i) {
        const int at = of.first[i], full = of.first[i + 1] - at;
        const Vector own = z.segment(at, full).cwiseProduct(of.column.segment(at, full)), shifts = of.E[i] * own;
        for (int e = 0; e < full; ++e) dz[of.laws[i].multiplier(e)] = own[e];
        for (int e = 0; e < shifts.size(); ++e) kappa[subset.row(i, e)] = shifts[e];
    }
    Eigen::Map<const Vector> R_a(r.R, nv), R_U(r.R + nv, nv), R_Q(r.R + 2 * nv, nv);
    const Vector dU = by(by_M_, collect(subset, dz.segment(k, j)) - R_U);
    const Vector dQ = by(by_M_, collect(subset, kappa) - R_Q);
    const Vector da = by(by_S_, collect(subset, dz.tail(j)) - R_a - by(D_, dU) - by(KT_, dQ));
    Eigen::Map<Vector> x(kernel::iterate_of(&plan, next).x, 3 * nv + n);
    Vector dx(3 * nv + n);
    dx << da, dU, dQ, dz;
    x = Eigen::Map<const Vector>(it.x, 3 * nv + n) + dx;
    kernel::nga_move(&plan, step, next);
}

}  // namespace nga
