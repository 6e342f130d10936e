#include "plain_steps.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "force_laws.hpp"

namespace nga {
namespace {

using kernel::Plan;

// from this residual nothing comes back
constexpr double LOST = 1e30;
// index sets that come back this often without a better residual are a cycle, from a number of corrections on
constexpr int MAX_RETURNS = 3, BEFORE_CYCLES = 8;

template <class Sizes>
int block_size(Sizes sizes, const Plan &plan) {
    int each[64] = {0};
    sizes(&plan, each);
    return std::accumulate(each, each + 64, 0);
}

int rows_of(const Plan &plan) { return plan.k + plan.m; }

int tied_rows(const Plan &plan) { return plan.kb + plan.mb; }

// of contacts, joint friction and constraints
int multipliers(const Plan &plan) { return plan.k + 2 * (rows_of(plan) + plan.nf + tied_rows(plan)) + plan.kb; }

// multipliers of the rows of constraints on velocity level; those on acceleration level come after them
int first_tied(const Plan &plan) { return 3 * plan.nv + plan.k + 2 * (rows_of(plan) + plan.nf) + plan.kb; }

// torques of joint friction among the unknowns
int first_torque(const Plan &plan) { return 3 * plan.nv + plan.k + 2 * rows_of(plan) + plan.nf; }

Eigen::Map<const Eigen::VectorXd> vector(const double *from, int n) { return {from, n}; }

Bodies bodies_of(const Mechanism &mechanism, std::size_t joints) {
    Bodies found;
    for (int joint = 0; joint < static_cast<int>(joints); ++joint) {
        found.rotations.push_back(mechanism.rotation(joint)), found.translations.push_back(mechanism.translation(joint));
        found.linear.push_back(mechanism.linear(joint)), found.angular.push_back(mechanism.angular(joint));
    }
    return found;
}

double *put(double *to, const double *from, int n) { return std::copy(from, from + n, to); }

}  // namespace

void Servos::operator()(double, const Eigen::VectorXd &q, const Eigen::VectorXd &v, double *tau, double *K,
                        double *D) const {
    const std::size_t nv = place.size();
    std::fill(K, K + nv * nv, 0.0), std::fill(D, D + nv * nv, 0.0);
    for (std::size_t i = 0; i < nv; ++i) {
        double force = held.empty() ? 0.0 : held[i], by_q = 0.0, by_v = 0.0;
        for (std::size_t law = 0; law < kp.size(); ++law) {
            const double away = place[i] < 0 ? 0.0 : rest[law][i] - q[place[i]];
            force += kp[law][i] * away - kd[law][i] * v[i];
            by_q -= kp[law][i], by_v -= kd[law][i];
        }
        if (!lower.empty() && (force > upper[i] || force < lower[i])) {
            force = force > upper[i] ? upper[i] : lower[i];
            by_q = by_v = 0.0;
        }
        if (!damping.empty()) force -= damping[i] * v[i], by_v -= damping[i];
        tau[i] = force, K[i * nv + i] = by_q, D[i * nv + i] = by_v;
    }
    if (laws != nullptr) laws->add(q, v, tau, K, D);
}

PlainSteps::PlainSteps(const std::string &model, Fixed fixed) : fixed_(std::move(fixed)), mechanism_(model, fixed_.beams) {
    const int nv = mechanism_.nv();
    tau_.assign(nv, 0.0), K_.assign(nv * nv, 0.0), D_.assign(nv * nv, 0.0);
    mechanism_.show(live_);
    q_.resize(mechanism_.nq()), v_.resize(nv), a_.resize(nv), dq_.resize(nv);
    live_.tau = tau_.data(), live_.reach = fixed_.reach.data(), live_.q = q_.data();
    live_.K_forces = {K_.data(), 1, nv}, live_.D_forces = {D_.data(), 1, nv};
    tie();
}

// Shows the joints between frames to the kernel.
void PlainSteps::tie() {
    const Ties &ties = fixed_.ties;
    wanted_.assign(3 * ties.follows.size(), 0.0);
    for (int joint : ties.joints) {
        tied_.push_back(mechanism_.rotation(joint));
        tied_.push_back(mechanism_.translation(joint));
    }
    frames_ = {static_cast<int>(ties.kind.size()), ties.kb, static_cast<int>(ties.joints.size()),
               ties.kind.data(), ties.a.data(), ties.b.data(), ties.group.data(),
               ties.vector_a.data(), ties.point_a.data(), ties.point_b.data(), ties.vector_b.data(),
               ties.length.data(), ties.support.data(), tied_.data(), ties.unit, ties.vanishes,
               static_cast<int>(ties.turn.size()), ties.first_part.data(), ties.part.data(), ties.first_power.data(),
               ties.factor.data(), ties.power.data(), ties.turn.data(), ties.rows.data(),
               ties.follows.data(), wanted_.data()};
    live_.frames = ties.group.empty() ? nullptr : &frames_;
}

int PlainSteps::add(const Plan &plan, const std::vector<int> &bodies) {
    auto subset = std::make_unique<Subset>();
    subset->plan = plan;
    live_.features = plan.live->features;
    for (int body : bodies) {
        subset->poses.push_back(mechanism_.rotation(body));
        subset->poses.push_back(mechanism_.translation(body));
    }
    subset->plan.live = &live_, subset->plan.poses = subset->poses.data();
    subset->step = block_size(kernel::nga_step_sizes, plan);
    subset->iterate = block_size(kernel::nga_iterate_sizes, plan);
    subset->rows = block_size(kernel::nga_rows_sizes, plan);
    subsets_.push_back(std::move(subset));
    return static_cast<int>(subsets_.size()) - 1;
}

int PlainSteps::width(int subset) const {
    const Plan &plan = subsets_.at(subset)->plan;
    return 4 + mechanism_.nq() + 3 * plan.nv + 4 * rows_of(plan) + 3 * plan.nf + 2 * tied_rows(plan) +
           plan.k;
}

void PlainSteps::run(int number, int near, const std::vector<char> &open_near, const Course &course, const Loads &loads,
                     Moment &moment, int n, double *record, int &done) {
    Subset &subset = prepared(number);
    Subset *looked_at = near < 0 ? nullptr : subsets_.at(near).get();
    const int k = subset.plan.k, open = static_cast<int>(std::count(open_near.begin(), open_near.end(), 1));
    const bool searched = fixed_.contacts, solid = !fixed_.motion.empty();
    const Bodies bodies = course.near == nullptr ? Bodies() : bodies_of(mechanism_, course.near->pairs().extent.size());
    while (done < n) {
        // a contact without a force is reported by one state only, and then forgotten
        if ((moment.la_bar.head(k).array() == 0.0).any()) return;
        begin(subset, course, moment);
        const kernel::Step step = kernel::step_of(&subset.plan, step_.data());
        const double motion = solid ? course.numbers[0] * fixed_.motion.most(moment.v.data(), fixed_.reach) : step.motion[0];
        const bool again = open > course.again && moment.clearance > course.relaxed * motion;
        if (searched && (!(moment.clearance > 2.0 * motion) || again)) return;
        if (course.near != nullptr) {
            mechanism_.place(moment.q, moment.v);
            if (!course.near->all_apart(bodies, course.ahead)) return;
        }
        start(subset, moment);
        const Newton found = newton(subset, loads, moment, course.max_iter);
        if (!found.solved) return;
        const kernel::Iterate end = kernel::iterate_of(&subset.plan, iterate_.data());
        const double spent = solid ? fixed_.motion.most(end.dq, fixed_.reach) : end.spent[0];
        if (searched && (!(moment.clearance > spent) || closes(looked_at, open_near))) return;
        if (course.divides && ends_slip(subset, moment)) return;
        moment.t += course.numbers[0];
        if (searched) moment.clearance -= spent;
        keep(subset, moment, found.iterations, record + static_cast<std::size_t>(done) * width(number));
        ++done, ++steps;
        const double *kept = kernel::iterate_of(&subset.plan, iterate_.data()).keep;
        if (std::any_of(kept, kept + k, [](double x) { return x == 0.0; })) return;
    }
}

// A subset with room to work in.
PlainSteps::Subset &PlainSteps::prepared(int number) {
    Subset &subset = *subsets_.at(number);
    const std::size_t work = block_size(kernel::nga_work_sizes, subset.plan);  // of those that are looked at it is too large
    if (work > work_.size()) work_.resize(work);
    subset.plan.work = work_.data();
    return subset;
}

void PlainSteps::begin(Subset &subset, const Course &course, const Moment &moment) {
    const Plan &plan = subset.plan;
    step_.assign(subset.step, 0.0);
    double *at = put(step_.data(), course.numbers.data(), static_cast<int>(course.numbers.size()));
    if (course.loaded || !fixed_.beams.empty()) find_span(moment.q, at);
    at += plan.nv;
    for (const auto *part : {&moment.a, &moment.a_bar, &moment.v, &moment.la, &moment.la_bar,
                             &moment.tau_f, &moment.tau_f_bar})
        at = put(at, part->data(), static_cast<int>(part->size()));
    kernel::nga_begin_step(&plan, step_.data());
    if (course.follows) course.follows(moment.t + course.numbers[0], wanted_.data());
    if (!course.bounces || plan.k == 0) return;
    mechanism_.jacobians(moment.q, moment.v), q_ = moment.q;
    rows_.assign(subset.rows, 0.0);
    kernel::nga_rebound(&plan, step_.data(), rows_.data());
}

// The first iterate: the acceleration and the forces of the start of the step, no impulses.
void PlainSteps::start(Subset &subset, const Moment &moment) {
    const Plan &plan = subset.plan;
    iterate_.assign(subset.iterate, 0.0);
    double *x = kernel::iterate_of(&plan, iterate_.data()).x;
    put(x, moment.a.data(), plan.nv);
    put(x + 3 * plan.nv + plan.k + rows_of(plan), moment.la.data(), rows_of(plan));
    put(x + first_torque(plan), moment.tau_f.data(), plan.nf);
    put(x + first_tied(plan) + tied_rows(plan), moment.la_b.data(), tied_rows(plan));
    kernel::nga_move(&plan, step_.data(), iterate_.data());
}

// Newton's method from the iterate; `semi_smooth_newton` without the smallest solutions of dependent directions.
Newton PlainSteps::newton(Subset &subset, const Loads &loads, const Moment &moment, int max_iter, double growth,
                          bool all_derivatives) {
    Newton found;
    const bool first = kernel::step_of(&subset.plan, step_.data()).scaled[0] == 0.0;
    error_ = evaluate(subset, loads, moment);
    found.refused = first && still(subset);
    if (found.refused) return found;
    const double runs_away = growth * std::max(error_, 1.0);
    for (; found.iterations < max_iter; ++found.iterations) {
        found.solved = error_ <= 1.0;
        if (found.solved || !(error_ < LOST) || error_ > runs_away) return found;
        if (subset.plan.k && circles(subset.plan, found)) return found;
        found.dependent = !(all_derivatives ? correct_by_differences(subset, loads, moment) : correct(subset, moment));
        if (found.dependent) return found;
        error_ = evaluate(subset, loads, moment);
    }
    found.solved = error_ <= 1.0;
    return found;
}

bool PlainSteps::circles(const Plan &plan, Newton &found) {
    const double *holds = kernel::rows_of(&plan, rows_.data()).holds;
    const int times = ++found.seen[std::string(reinterpret_cast<const char *>(holds), multipliers(plan) * sizeof(double))];
    return found.seen.size() > 1 && times > MAX_RETURNS && found.iterations > BEFORE_CYCLES;
}

double PlainSteps::evaluate(Subset &subset, const Loads &loads, const Moment &moment) {
    const Plan &plan = subset.plan;
    const kernel::Iterate it = kernel::iterate_of(&plan, iterate_.data());
    ++evaluations;
    v_ = vector(it.v, plan.nv), a_ = vector(it.x, plan.nv), dq_ = vector(it.dq, plan.nv);
    mechanism_.integrate(moment.q, dq_, q_);
    mechanism_.dynamics(q_, v_, a_);
    const kernel::Step step = kernel::step_of(&plan, step_.data());
    if (loads) load(loads, moment.t + step.dt[0]);
    rows_.assign(subset.rows, 0.0);
    if (plan.nf && !fixed_.flat && step.scaled[0] == 0.0)
        mechanism_.d_integrate(moment.q, dq_, kernel::work_of(&plan).T);  // stiffness is in the scales of joint friction
    return kernel::nga_evaluate(&plan, step_.data(), iterate_.data(), rows_.data());
}

// The forces of the scene, which act on the tree alone.
void PlainSteps::load(const Loads &loads, double t) {
    if (fixed_.beams.empty()) return loads(t, q_, v_, tau_.data(), K_.data(), D_.data());
    const int n = mechanism_.nv_tree(), nv = mechanism_.nv();
    Eigen::MatrixXd K(n, n), D(n, n);
    loads(t, q_.head(mechanism_.nq_tree()), v_.head(n), tau_.data(), K.data(), D.data());
    Eigen::Map<Eigen::MatrixXd>(K_.data(), nv, nv).topLeftCorner(n, n) = K;
    Eigen::Map<Eigen::MatrixXd>(D_.data(), nv, nv).topLeftCorner(n, n) = D;
}

bool PlainSteps::correct(Subset &subset, const Moment &moment) {
    const Plan &plan = subset.plan;
    ++corrections;
    if (!fixed_.flat) mechanism_.d_integrate(moment.q, dq_, kernel::work_of(&plan).T);
    next_.assign(subset.iterate, 0.0);
    if (kernel::nga_correct(&plan, step_.data(), iterate_.data(), rows_.data(), next_.data())) return false;
    iterate_.swap(next_);
    return true;
}

bool PlainSteps::closes(Subset *near, const std::vector<char> &open_near) {
    if (near == nullptr) return false;
    gaps_.resize(near->plan.k);
    kernel::nga_find_gaps(&near->plan, gaps_.data(), nullptr);
    for (int i = 0; i < near->plan.k; ++i)
        if (open_near[i] && gaps_[i] < 0.0) return true;
    return false;
}

// Friction on the edge of its cone at the start, and inside of it or the other way at the end.
bool PlainSteps::ends_slip(const Subset &subset, const Moment &moment) {
    const Plan &plan = subset.plan;
    const kernel::Iterate it = kernel::iterate_of(&plan, iterate_.data());
    const double *start = moment.la.data(), *end = it.x + 3 * plan.nv + plan.k + rows_of(plan);
    const double *mu = kernel::table_of(&plan).mu;
    const int *first_F = kernel::index_of(&plan).first_F;
    const double inside = 2.0 - kernel::step_of(&plan, step_.data()).EDGE[0];
    const auto on_edge = [&](int i, double normal, double squares) {
        const double radius = mu[i] * normal * inside;
        return squares > 0.0 && squares >= radius * radius;
    };
    for (int i = 0; i < plan.k; ++i) {
        double before = 0.0, after = 0.0, both = 0.0;
        for (int f = plan.k + first_F[i]; f < plan.k + first_F[i + 1]; ++f)
            before += start[f] * start[f], after += end[f] * end[f], both += start[f] * end[f];
        if (!on_edge(i, start[i], before) || it.keep[i] == 0.0 || !(end[i] > 0.0)) continue;
        if (both <= 0.0 || !on_edge(i, end[i], after)) return true;
    }
    const kernel::Table bounds = kernel::table_of(&plan);
    const auto side = [&](int i, double tau) {
        return (tau >= bounds.upper[i] * inside) - (tau <= bounds.lower[i] * inside);
    };
    for (int i = 0; i < plan.nf; ++i) {
        const int slipped = side(i, moment.tau_f[i]);
        if (slipped != 0 && slipped != side(i, it.x[first_torque(plan) + i])) return true;
    }
    return false;
}

void PlainSteps::keep(Subset &subset, Moment &moment, int iterations, double *record) {
    const Plan &plan = subset.plan;
    const int nv = plan.nv, k = plan.k, j = rows_of(plan);
    const kernel::Iterate it = kernel::iterate_of(&plan, iterate_.data());
    const int b = tied_rows(plan);
    const double *La = it.x + 3 * nv + k, *la = La + j, *P = it.z + k, *a_bar = it.a_bar, *la_bar = it.la_bar;
    const double *La_b = it.x + first_tied(plan);
    moment.q = q_, moment.v = v_, moment.a = a_, moment.a_bar = vector(a_bar, nv);
    moment.la = vector(la, j), moment.la_bar = vector(la_bar, j), moment.la_b = vector(La_b + b, b);
    for (double x : {moment.t, moment.clearance, static_cast<double>(iterations), error_}) *record++ = x;
    record = put(record, q_.data(), mechanism_.nq());
    for (const double *part : {moment.v.data(), moment.a.data(), moment.a_bar.data()}) record = put(record, part, nv);
    for (const double *part : {la, La, P, la_bar}) record = put(record, part, j);
    moment.tau_f = vector(it.x + first_torque(plan), plan.nf), moment.tau_f_bar = vector(it.bar_f, plan.nf);
    for (const double *part : {it.x + first_torque(plan), it.P_f, it.bar_f}) record = put(record, part, plan.nf);
    record = put(record, La_b, 2 * b);
    put(record, it.keep, k);
}

// Size of the positions of each coordinate, whose rounding stiff springs feel.
void PlainSteps::find_span(const Eigen::VectorXd &q, double *span) const {
    if (!fixed_.beams.empty()) return mechanism_.beams().find_span(q.data() + mechanism_.nq_tree(), span + mechanism_.nv_tree());
    double length = fixed_.length, angle = 1.0;
    for (int i : fixed_.lengths) length = std::max(length, std::abs(q[i]));
    for (int i : fixed_.angles) angle = std::max(angle, std::abs(q[i]));
    for (std::size_t i = 0; i < fixed_.slides.size(); ++i) span[i] = fixed_.slides[i] ? length : angle;
}

}  // namespace nga
