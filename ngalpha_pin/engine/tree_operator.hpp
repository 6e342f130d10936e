// What TreeOperator does; included where it is instantiated.
#pragma once
#include <algorithm>
#include <cmath>

#include "contact_problem.hpp"

namespace nga {

template <int N>
void TreeOperator<N>::prepare(const Problem &problem) {
    problem_ = &problem;
    groups_ = problem.groups;
    const int trees = static_cast<int>(problem.sizes.size()), count = static_cast<int>(groups_.size());
    M_.resize(trees);
    M_inverse_.resize(trees);
    v_.resize(trees);
    right_.resize(trees);
    for (int t = 0, at = 0; t < trees; ++t) {
        const int n = size(t);
        M_[t] = Eigen::Map<const Eigen::Matrix<double, N, N, Eigen::RowMajor>>(&problem.M[at], n, n);
        M_inverse_[t] = M_[t].inverse();
        v_[t] = right_[t] = Velocity::Zero(n);
        at += n * n;
    }
    by_M_.resize(problem.J.size());
    own_.assign(count * MOST_ROWS * MOST_ROWS, 0.0);
    if (!problem.compliance.empty()) own_ = problem.compliance;
    first_leg_.assign(count + 1, 0);
    for (const Leg &leg : problem.legs) {
        ++first_leg_[leg.group + 1];
        const int n = size(leg.tree), m = groups_[leg.group].rows;
        double *block = &own_[leg.group * MOST_ROWS * MOST_ROWS];
        for (int i = 0; i < m; ++i) {
            Eigen::Map<const Velocity> J_i(row(leg, i), n);
            Eigen::Map<Velocity> column(&by_M_[leg.at + i * n], n);
            column.noalias() = M_inverse_[leg.tree] * J_i;
            for (int j = 0; j < m; ++j) block[j * MOST_ROWS + i] += Eigen::Map<const Velocity>(row(leg, j), n).dot(column);
        }
    }
    for (int g = 0; g < count; ++g) {
        first_leg_[g + 1] += first_leg_[g];
        groups_[g].s_N = std::max(own(g)[0], 1e-300);
        groups_[g].s_F = 1e-300;
        for (int i = 1; i < groups_[g].rows; ++i)
            groups_[g].s_F = std::max(groups_[g].s_F, own(g)[i * (MOST_ROWS + 1)]);
    }
    find_graph();
}

template <int N>
void TreeOperator<N>::find_graph() {
    graph_.clear();
    for (std::size_t g = 0; g + 1 < first_leg_.size(); ++g)
        for (int a = first_leg_[g]; a < first_leg_[g + 1]; ++a)
            for (int b = a + 1; b < first_leg_[g + 1]; ++b) {
                const int i = problem_->legs[a].tree, j = problem_->legs[b].tree;
                graph_.emplace_back(std::min(i, j), std::max(i, j));
            }
    std::sort(graph_.begin(), graph_.end());
    graph_.erase(std::unique(graph_.begin(), graph_.end()), graph_.end());
    lu_.analyse(problem_->sizes, graph_);
}

template <int N>
void TreeOperator<N>::evaluate(const Vector &P, Vector &y) {
    for (Velocity &v : v_) v.setZero();
    for (std::size_t g = 0; g < groups_.size(); ++g) change(static_cast<int>(g), &P[groups_[g].first]);
    for (std::size_t g = 0; g < groups_.size(); ++g)
        local(static_cast<int>(g), &P[groups_[g].first], &y[groups_[g].first]);
}

template <int N>
void TreeOperator<N>::local(int group, const double *P, double *y) const {
    const Group &rows = groups_[group];
    for (int i = 0; i < rows.rows; ++i) y[i] = problem_->bias[rows.first + i];
    for (int l = first_leg_[group]; l < first_leg_[group + 1]; ++l) {
        const Leg &leg = problem_->legs[l];
        for (int i = 0; i < rows.rows; ++i)
            y[i] += Eigen::Map<const Velocity>(row(leg, i), size(leg.tree)).dot(v_[leg.tree]);
    }
    if (problem_->compliance.empty()) return;
    const double *E = &problem_->compliance[group * MOST_ROWS * MOST_ROWS];
    for (int i = 0; i < rows.rows; ++i)
        for (int j = 0; j < rows.rows; ++j) y[i] += E[i * MOST_ROWS + j] * P[j];
}

template <int N>
void TreeOperator<N>::change(int group, const double *d) {
    for (int l = first_leg_[group]; l < first_leg_[group + 1]; ++l) {
        const Leg &leg = problem_->legs[l];
        const int n = size(leg.tree);
        for (int i = 0; i < groups_[group].rows; ++i)
            v_[leg.tree] += d[i] * Eigen::Map<const Velocity>(&by_M_[leg.at + i * n], n);
    }
}

template <int N>
void TreeOperator<N>::eliminate_compliance() {
    F_.resize(groups_.size());
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> E(&problem_->compliance[g * 16]);
        F_[g] = (Eigen::Matrix4d::Identity() + C_[g] * E).inverse();
        C_[g] = (F_[g] * C_[g]).eval();
    }
}

template <int N>
void TreeOperator<N>::factorise(const std::vector<Response> &responses) {
    C_.resize(groups_.size());
    for (std::size_t g = 0; g < groups_.size(); ++g)
        C_[g] = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(&responses[g].C[0][0]);
    if (!problem_->compliance.empty()) eliminate_compliance();
    lu_.set_zero();
    for (std::size_t t = 0; t < M_.size(); ++t) lu_(static_cast<int>(t), static_cast<int>(t)) = M_[t];
    Velocity by_C;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        const int m = groups_[g].rows;
        if ((C_[g].array() == 0.0).all()) continue;
        for (int b = first_leg_[g]; b < first_leg_[g + 1]; ++b)
            for (int i = 0; i < m; ++i) {
                const Leg &second = problem_->legs[b];
                const int n = size(second.tree);
                by_C = C_[g](i, 0) * Eigen::Map<const Velocity>(row(second, 0), n);
                for (int j = 1; j < m; ++j) by_C += C_[g](i, j) * Eigen::Map<const Velocity>(row(second, j), n);
                for (int a = first_leg_[g]; a < first_leg_[g + 1]; ++a) {
                    const Leg &first = problem_->legs[a];
                    lu_(first.tree, second.tree).noalias() +=
                        Eigen::Map<const Velocity>(row(first, i), size(first.tree)) * by_C.transpose();
                }
            }
    }
    lu_.factorise();
}

// The right side J^T p of the trees.
template <int N>
void TreeOperator<N>::collect(const Vector &p) {
    for (Velocity &right : right_) right.setZero();
    for (const Leg &leg : problem_->legs) {
        const Group &group = groups_[leg.group];
        for (int i = 0; i < group.rows; ++i)
            right_[leg.tree] += p[group.first + i] * Eigen::Map<const Velocity>(row(leg, i), size(leg.tree));
    }
}

// J of the velocities in right_, without the compliance.
template <int N>
void TreeOperator<N>::spread(Vector &dy) const {
    dy.setZero();
    for (const Leg &leg : problem_->legs) {
        const Group &group = groups_[leg.group];
        for (int i = 0; i < group.rows; ++i)
            dy[group.first + i] += Eigen::Map<const Velocity>(row(leg, i), size(leg.tree)).dot(right_[leg.tree]);
    }
}

// dP = p - C dy, then what E dP adds to dy.
template <int N>
void TreeOperator<N>::answer(const Vector &p, Vector &dP, Vector &dy) const {
    dP = p;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        const int m = groups_[g].rows, first = groups_[g].first;
        for (int i = 0; i < m; ++i)
            for (int j = 0; j < m; ++j) dP[first + i] -= C_[g](i, j) * dy[first + j];
    }
    comply(dP, dy);
}

template <int N>
void TreeOperator<N>::comply(const Vector &dP, Vector &dy) const {
    if (problem_->compliance.empty()) return;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        const int m = groups_[g].rows, first = groups_[g].first;
        const double *E = &problem_->compliance[g * MOST_ROWS * MOST_ROWS];
        for (int i = 0; i < m; ++i)
            for (int j = 0; j < m; ++j) dy[first + i] += E[i * MOST_ROWS + j] * dP[first + j];
    }
}

// dy = G dP.
template <int N>
void TreeOperator<N>::apply(const Vector &dP, Vector &dy) {
    collect(dP);
    for (std::size_t t = 0; t < right_.size(); ++t) right_[t] = (M_inverse_[t] * right_[t]).eval();
    spread(dy);
    comply(dP, dy);
}

template <int N>
void TreeOperator<N>::step(const std::vector<Response> &responses, Vector &dP, Vector &dy, int refinements) {
    p_.resize(dP.size());
    for (std::size_t g = 0; g < groups_.size(); ++g) {
        Eigen::Vector4d p(responses[g].p);
        if (!problem_->compliance.empty()) p = (F_[g] * p).eval();
        for (int i = 0; i < groups_[g].rows; ++i) p_[groups_[g].first + i] = p[i];
    }
    collect(p_);
    lu_.solve(right_);
    spread(dy);
    answer(p_, dP, dy);
    for (int r = 0; r < refinements; ++r) {
        apply(dP, dy);
        rest_ = p_ - dP;
        for (std::size_t g = 0; g < groups_.size(); ++g) {
            const int m = groups_[g].rows, first = groups_[g].first;
            for (int i = 0; i < m; ++i)
                for (int j = 0; j < m; ++j) rest_[first + i] -= C_[g](i, j) * dy[first + j];
        }
        collect(rest_);
        lu_.solve(right_);
        spread(dy);
        answer(rest_, more_, dy);
        dP += more_;
    }
    if (refinements) apply(dP, dy);
}

}  // namespace nga
