// One step in one piece, for the caller to accept or to divide; and Newton's method alone on equations of his.
#include <algorithm>

#include "plain_steps.hpp"

namespace nga {

Newton PlainSteps::attempt(int number, int near, const std::vector<char> &open_near, const Course &course,
                           const Loads &loads, const Moment &moment, double growth, std::vector<double> &record,
                           std::vector<int> &closing, std::vector<double> &gaps, double &spent) {
    Subset &subset = prepared(number);
    ++attempts;
    begin(subset, course, moment);
    start(subset, moment);
    Newton found = newton(subset, loads, moment, course.max_iter, growth);
    if (!found.solved) return found;
    ++solved;
    const kernel::Iterate last = kernel::iterate_of(&subset.plan, iterate_.data());
    spent = fixed_.motion.empty() ? last.spent[0] : fixed_.motion.most(last.dq, fixed_.reach);
    if (near >= 0) {
        const kernel::Plan &looked_at = subsets_.at(near)->plan;
        gaps_.resize(looked_at.k);
        kernel::nga_find_gaps(&looked_at, gaps_.data(), nullptr);
        for (int i = 0; i < looked_at.k; ++i)
            if (open_near[i] && gaps_[i] < 0.0) closing.push_back(i), gaps.push_back(gaps_[i]);
    }
    record.resize(width(number));
    Moment end = moment;
    end.t += course.numbers[0];
    keep(subset, end, found.iterations, record.data());
    return found;
}

Newton PlainSteps::solve(int number, const Loads &loads, const Follows &follows, double t, const Eigen::VectorXd &q,
                         const double *step, double *iterate, int max_iter, double growth, bool all_derivatives) {
    Subset &subset = prepared(number);
    step_.assign(step, step + subset.step);
    iterate_.assign(iterate, iterate + subset.iterate);
    Moment moment;
    moment.t = t, moment.q = q;
    if (follows) follows(t + kernel::step_of(&subset.plan, step_.data()).dt[0], wanted_.data());
    Newton found = newton(subset, loads, moment, max_iter, growth, all_derivatives);
    std::copy(iterate_.begin(), iterate_.end(), iterate);
    return found;
}

}  // namespace nga
