#include "places.hpp"

#include <map>

namespace nga {
namespace {

constexpr double MOVABLE = 1e-9;     // of tolerances.py
// features further apart than this part of the smaller shape, or with normals this different, are not the same one
constexpr double SAME = 0.2, SAME_NORMAL = 0.5;
// poses and turns for which features are chosen, in parts of the size of a pair and of a radian: bodies at rest quiver by
// less than this, and what is chosen for the one pose serves the other; gaps are those of the pose itself
constexpr double GRID = 1.0 / (1LL << 48);

using Old = std::map<int, Row>;  // what was in the places of a pair

// Numbers rounded to a grid that is fine beside a size, and a power of two, so that they are exact; no zero has a sign.
template <class T> T on_grid(const T &x, double size) {
    const double grid = GRID * std::exp2(std::floor(std::log2(size)));
    return x.unaryExpr([grid](double value) { return std::nearbyint(value / grid) * grid + 0.0; });
}

Turn turn_of(const Bodies &bodies, int a, int b, double dt) {
    if (std::isnan(dt)) return std::nullopt;
    const Vector omega_b = bodies.pose(b).R * bodies.omega(b);
    return dt * (bodies.pose(a).R.transpose() * omega_b - bodies.omega(a));
}

// The place of every feature: that of the nearest one of the step before, or a free one, or -1.
std::vector<int> placed(int pair, const Old &old, const std::vector<Row> &found, const Pose &X, double same,
                        const std::vector<int> &kept) {
    const int n = static_cast<int>(found.size());
    std::vector<int> places(n, -1);
    for (int k = 0; k < n; ++k)
        for (const auto &[j, row] : old)
            if (row.same(found[k])) places[k] = j;
    std::vector<int> once = places;
    std::sort(once.begin(), once.end());
    const bool all = std::adjacent_find(once.begin(), once.end()) == once.end() && (n == 0 || once[0] >= 0);
    if (!all) {  // not all of them are there as they were
        std::fill(places.begin(), places.end(), -1);
        struct Cost {
            double away;
            int feature, place;
        };
        std::vector<Cost> costs;
        for (int k = 0; k < n; ++k)
            for (const auto &[j, row] : old) costs.push_back({apart(found[k], row, X), k, j});
        std::stable_sort(costs.begin(), costs.end(), [](const Cost &a, const Cost &b) { return a.away < b.away; });
        std::vector<int> taken;
        for (const Cost &cost : costs) {
            if (!(cost.away < same)) break;
            if (places[cost.feature] >= 0 || std::find(taken.begin(), taken.end(), cost.place) != taken.end()) continue;
            places[cost.feature] = cost.place, taken.push_back(cost.place);
        }
    }
    std::vector<int> used = places;
    used.insert(used.end(), kept.begin(), kept.end());
    int next = pair * SLOTS;
    for (int &place : places) {
        if (place >= 0) continue;
        while (next < (pair + 1) * SLOTS && std::find(used.begin(), used.end(), next) != used.end()) ++next;
        if (next < (pair + 1) * SLOTS) place = next++;
    }
    return places;
}

}  // namespace

void Table::put(int place, const Row &row) const {
    std::copy(row.x.begin(), row.x.end(), packed + WIDTH * place);
    loaded[place] = true;
}

double apart(const Row &a, const Row &b, const Pose &X) {
    if (!(a.normal().dot(b.normal()) > SAME_NORMAL)) return INFINITY;
    double found = INFINITY;
    for (int start : {0, SIDE}) {
        if (a.is_face(start) || b.is_face(start)) continue;
        const double turned = std::sqrt((a.Q(start) - b.Q(start)).norm());
        found = std::min(found, (a.place(start) - b.place(start)).norm() + turned);
    }
    if (std::isfinite(found)) return found;
    const auto place = [&](const Row &row) { return row.is_face(0) ? X.act(row.place(SIDE)) : row.place(0); };
    return (place(a) - place(b)).norm();
}

const std::vector<Row> &Places::features(int i, const Pose &X, const Turn &turn, const std::vector<Row> &before,
                                         const std::vector<Row> &carry, const double *mobility) {
    const ShapePair &pair = near_->pairs().shapes[i];
    const Pose at{on_grid(X.R, 1.0), on_grid(X.p, pair.size())};
    const Turn turned = turn ? Turn(on_grid(*turn, 1.0)) : Turn();
    std::vector<double> asked(at.R.data(), at.R.data() + 9);
    asked.insert(asked.end(), at.p.data(), at.p.data() + 3);
    for (const std::vector<Row> *rows : {&before, &carry}) {
        asked.push_back(static_cast<double>(rows->size()));
        for (const Row &row : *rows) asked.insert(asked.end(), row.x.begin(), row.x.end());
    }
    if (turned) asked.insert(asked.end(), turned->data(), turned->data() + 3);
    Chosen &chosen = chosen_[i];
    if (asked == chosen.asked) return chosen.rows;
    ++looks;
    const Eigen::Map<const Matrix> G(mobility + 9 * i);
    const double least = MOVABLE * MOVABLE * G.trace();
    chosen.rows = pair.features(at, turned, before, carry);
    const auto stuck = [&](const Row &row) { return !(row.normal().dot(G * row.normal()) > least); };
    chosen.rows.erase(std::remove_if(chosen.rows.begin(), chosen.rows.end(), stuck), chosen.rows.end());
    chosen.asked = std::move(asked);
    return chosen.rows;
}

void Places::load(const Bodies &bodies, const double *contents, int n, const std::vector<int> &carries, double dt,
                  double within, const Table &table) {
    std::fill(added_.begin(), added_.end(), false);
    std::map<int, Old> old;
    for (int k = 0; k < n; ++k, contents += 1 + WIDTH) {
        const int place = static_cast<int>(contents[0]);
        old[place / SLOTS].insert_or_assign(place, Row(contents + 1));
    }
    std::map<int, std::vector<int>> kept;
    for (int place : carries) kept[place / SLOTS].push_back(place);
    std::vector<int> pairs = near_->within(bodies, within, std::isnan(dt) ? 0.0 : TOUCH_STEPS * dt);
    for (const auto &entry : kept) pairs.push_back(entry.first);
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    const Old none;
    for (int i : pairs) {
        const auto before = old.find(i);
        const auto forces = kept.find(i);
        const Old &here = before == old.end() ? none : before->second;
        const std::vector<int> keeps = forces == kept.end() ? std::vector<int>() : forces->second;
        std::vector<Row> present, carry;
        for (const auto &[j, row] : here) {
            if (row.x[VANISHED] != 0.0) continue;
            present.push_back(row);
            if (std::find(keeps.begin(), keeps.end(), j) != keeps.end()) carry.push_back(row);
        }
        const int a = near_->pairs().a[i], b = near_->pairs().b[i];
        const Pose X = bodies.pose(a, b);
        const std::vector<Row> &found = features(i, X, turn_of(bodies, a, b, dt), present, carry, table.mobility);
        const std::vector<int> places = placed(i, here, found, X, SAME * near_->pairs().shapes[i].size(), keeps);
        for (std::size_t k = 0; k < found.size(); ++k)
            if (places[k] >= 0) table.put(places[k], found[k]);
        for (int j : keeps) {  // what has vanished while it carries a force
            const auto row = here.find(j);
            if (row == here.end() || table.loaded[j]) continue;
            std::copy(row->second.x.begin(), row->second.x.begin() + VANISHED, table.packed + WIDTH * j);
            table.loaded[j] = true;
        }
    }
}

int Places::place_for_more(int pair, const Pose &X, const Table &table) const {
    int widest = -1;
    double most = 0.0;
    for (int j = pair * SLOTS; j < (pair + 1) * SLOTS; ++j) {
        if (!table.loaded[j]) return j;
        if (!added_[j] || table.packed[WIDTH * j + VANISHED] != 0.0) continue;
        const double gap = gap_along_normal(table.row(j), X);
        if (gap > most) most = gap, widest = j;
    }
    return widest;
}

std::vector<int> Places::add_missing(const Bodies &bodies, const double *normals, double tol, const Table &table) {
    const Pairs &fixed = near_->pairs();
    std::vector<int> found;
    std::map<int, std::vector<int>> taken;                // places by pair
    std::map<int, const double *> of_place;               // their normals
    for (int j = 0; j < SLOTS * fixed.n(); ++j)
        if (table.loaded[j]) taken[j / SLOTS].push_back(j), of_place[j] = normals, normals += 3;
    for (int i : near_->within(bodies, tol, 0.0)) taken[i];
    for (const auto &[i, places] : taken) {
        const Pose X = bodies.pose(fixed.a[i], fixed.b[i]);
        const Matrix R_a = bodies.pose(fixed.a[i]).R;
        const ShapePair &pair = fixed.shapes[i];
        std::vector<Row> before;
        std::vector<Vector> tried;
        bool is_apart = false;
        for (int j : places) {
            if (table.packed[WIDTH * j + VANISHED] != 0.0) continue;
            const Vector n = R_a.transpose() * Eigen::Map<const Vector>(of_place[j]);
            before.push_back(table.row(j));
            Eigen::Map<Vector>(before.back().x.data() + NORMAL) = n;
            const auto parallel = [&](const Vector &m) { return n.dot(m) > 1 - 1e-14; };
            if (is_apart || std::any_of(tried.begin(), tried.end(), parallel)) continue;
            is_apart = pair.separation(X, n) >= -tol;
            tried.push_back(n);
        }
        if (is_apart || (before.empty() && pair.distance(X).distance > tol)) continue;
        for (const Row &row : features(i, X, std::nullopt, before, {}, table.mobility)) {
            if (gap_along_normal(row, X) >= -tol) continue;
            const int place = place_for_more(i, X, table);
            if (place < 0) break;
            table.put(place, row);
            added_[place] = true, found.push_back(place);
        }
    }
    return found;
}

}  // namespace nga
