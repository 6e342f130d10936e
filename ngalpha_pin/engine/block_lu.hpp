// Sparse LU factors of a matrix of blocks with a symmetric pattern, in an order of minimum degree.
//
// Pivots are whole blocks on the diagonal, which an inertia matrix and what is added to it allow. The pattern is kept as
// long as the graph of the blocks stays the same.
#pragma once
#include <Eigen/LU>
#include <algorithm>
#include <utility>
#include <vector>

namespace nga {

using Graph = std::vector<std::pair<int, int>>;  // pairs (i, j), i < j, sorted, each once

// Order of elimination, and for each step the later blocks that it touches.
struct Elimination {
    std::vector<int> order, place;
    std::vector<std::vector<int>> later;  // places, ascending

    Elimination() = default;
    Elimination(int n, const Graph &graph) : order(), place(n, -1), later(n) {
        std::vector<std::vector<char>> joined(n, std::vector<char>(n, 0));
        std::vector<int> degree(n, 0);
        for (auto [i, j] : graph) {
            joined[i][j] = joined[j][i] = 1;
            ++degree[i], ++degree[j];
        }
        std::vector<std::vector<int>> touched(n);
        for (int k = 0; k < n; ++k) {
            int best = -1;
            for (int i = 0; i < n; ++i)
                if (place[i] < 0 && (best < 0 || degree[i] < degree[best])) best = i;
            place[best] = k;
            order.push_back(best);
            for (int j = 0; j < n; ++j)
                if (joined[best][j] && place[j] < 0) touched[k].push_back(j);
            for (int i : touched[k]) {
                for (int j : touched[k])
                    if (i != j && !joined[i][j]) joined[i][j] = 1, ++degree[i];
                --degree[i];
            }
        }
        for (int k = 0; k < n; ++k) {
            for (int j : touched[k]) later[k].push_back(place[j]);
            std::sort(later[k].begin(), later[k].end());
        }
    }
};

// N: size of every block, or Eigen::Dynamic.
template <int N>
class BlockLU {
public:
    using Block = Eigen::Matrix<double, N, N>;
    using Vector = Eigen::Matrix<double, N, 1>;

    // Look at the pattern again where it is another one.
    void analyse(const std::vector<int> &sizes, const Graph &graph) {
        if (sizes == sizes_ && graph == graph_) return;
        sizes_ = sizes;
        graph_ = graph;
        n_ = static_cast<int>(sizes.size());
        plan_ = Elimination(n_, graph);
        slot_.assign(static_cast<std::size_t>(n_) * n_, -1);
        blocks_.clear();
        for (int k = 0; k < n_; ++k) {
            add(k, k);
            for (int j : plan_.later[k]) add(k, j), add(j, k);
        }
        inverse_.resize(n_);
        z_.resize(n_);
        for (int k = 0; k < n_; ++k) z_[k].resize(sizes_[plan_.order[k]]);
    }

    void set_zero() {
        for (Block &block : blocks_) block.setZero();
    }

    // Block of the matrix to be factorised.
    Block &operator()(int i, int j) { return at(plan_.place[i], plan_.place[j]); }

    void factorise() {
        Block factor;
        for (int k = 0; k < n_; ++k) {
            inverse_[k] = at(k, k).inverse();
            for (int i : plan_.later[k]) {
                factor.noalias() = at(i, k) * inverse_[k];
                at(i, k) = factor;
                for (int j : plan_.later[k]) at(i, j).noalias() -= factor * at(k, j);
            }
        }
    }

    // x solves the system for the right side x; both one vector for each block.
    void solve(std::vector<Vector> &x) {
        for (int k = 0; k < n_; ++k) z_[k] = x[plan_.order[k]];
        for (int k = 0; k < n_; ++k)
            for (int i : plan_.later[k]) z_[i].noalias() -= at(i, k) * z_[k];
        for (int k = n_ - 1; k >= 0; --k) {
            for (int j : plan_.later[k]) z_[k].noalias() -= at(k, j) * z_[j];
            x[plan_.order[k]].noalias() = inverse_[k] * z_[k];
            z_[k] = x[plan_.order[k]];
        }
    }

private:
    Block &at(int row, int column) { return blocks_[slot_[static_cast<std::size_t>(row) * n_ + column]]; }

    void add(int row, int column) {
        slot_[static_cast<std::size_t>(row) * n_ + column] = static_cast<int>(blocks_.size());
        blocks_.emplace_back(Block::Zero(sizes_[plan_.order[row]], sizes_[plan_.order[column]]));
    }

    int n_ = 0;
    std::vector<int> sizes_, slot_;
    Graph graph_;
    Elimination plan_;
    std::vector<Block> blocks_, inverse_;
    std::vector<Vector> z_;
};

}  // namespace nga
