// Arrays of Python's as the collision code takes them, and back.
#pragma once
#include <nanobind/ndarray.h>

#include <stdexcept>
#include <vector>

#include "solid.hpp"

namespace nga {

namespace nb = nanobind;

using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Made = nb::ndarray<nb::numpy, double>;

inline Vector vector_of(const Numbers &x) {
    if (x.size() != 3) throw std::invalid_argument("a vector has three numbers");
    return Eigen::Map<const Vector>(x.data());
}

inline Matrix matrix_of(const Numbers &x) {
    if (x.size() != 9) throw std::invalid_argument("a matrix has nine numbers");
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(x.data());
}

inline std::vector<Vector> vectors_of(const Numbers &x) {
    std::vector<Vector> found(x.size() / 3);
    for (std::size_t i = 0; i < found.size(); ++i) found[i] = Eigen::Map<const Vector>(x.data() + 3 * i);
    return found;
}

inline std::vector<Row> rows_of(const Numbers &x) {
    std::vector<Row> found;
    for (std::size_t i = 0; i < x.size() / WIDTH; ++i) found.emplace_back(x.data() + WIDTH * i);
    return found;
}

inline Turn turn_of(const nb::object &x) { return x.is_none() ? Turn() : Turn(vector_of(nb::cast<Numbers>(x))); }

// Of `columns` numbers a row, or one row where that is zero.
inline Made array(const double *from, std::size_t n, std::size_t columns) {
    double *data = new double[n + 1];
    std::copy(from, from + n, data);
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    if (columns == 0) return Made(data, {n}, owner);
    return Made(data, {n / columns, columns}, owner);
}

inline Made array(const Vector &x) { return array(x.data(), 3, 0); }

inline Made array(const std::vector<Row> &rows) {
    return array(rows.empty() ? nullptr : rows[0].x.data(), WIDTH * rows.size(), WIDTH);
}

}  // namespace nga
