#include "rod_strains.hpp"

namespace nga {
namespace {

using Vector4 = Eigen::Vector4d;
using Matrix4 = Eigen::Matrix4d;

// Constant forms: entry (j, k) of |P|^2 R is P^T turn[j][k] P, component k of vec(P* P') is P^T bend[k] P'.
struct Forms {
    Matrix4 turn[3][3], bend[3];
    Forms() {
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k) {
                Matrix4 &T = turn[j][k];
                T.setZero();
                if (j == k) {
                    T.diagonal().setConstant(-1.0);
                    T(j, j) = T(3, 3) = 1.0;
                } else {
                    const int other = 3 - j - k;
                    const double sign = (k - j + 3) % 3 == 1 ? -1.0 : 1.0;
                    T(j, k) = T(k, j) = 1.0;
                    T(3, other) = T(other, 3) = sign;
                }
            }
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            bend[k].setZero();
            bend[k](3, k) = 1.0, bend[k](k, 3) = -1.0;
            bend[k](i, j) = -1.0, bend[k](j, i) = 1.0;
        }
    }
};

const Forms &forms() {
    static const Forms found;
    return found;
}

}  // namespace

Vector6 strains(const Vector11 &x) {
    const Vector4 P = x.segment<4>(3), P_s = x.tail<4>();
    const double n = P.squaredNorm();
    Vector6 e;
    for (int k = 0; k < 3; ++k) {
        e[k] = 0.0;
        for (int j = 0; j < 3; ++j) e[k] += x[j] * P.dot(forms().turn[j][k] * P) / n;
        e[3 + k] = 2.0 * P.dot(forms().bend[k] * P_s) / n;
    }
    return e;
}

void strains(const Vector11 &x, Strains &to) {
    const Vector4 P = x.segment<4>(3), P_s = x.tail<4>();
    const double n = P.squaredNorm();
    to.G.setZero();
    for (int k = 0; k < 3; ++k) {
        // numerators, quadratic in P, and their derivatives
        Matrix4 S = Matrix4::Zero();
        Hessian &H = to.H[k], &L = to.H[3 + k];
        H.setZero(), L.setZero();
        for (int j = 0; j < 3; ++j) {
            const Matrix4 &T = forms().turn[j][k];
            S += x[j] * T;
            to.G(k, j) = P.dot(T * P);
            H.block<1, 4>(j, 3) = 2.0 * (T * P).transpose();
            H.block<4, 1>(3, j) = H.block<1, 4>(j, 3).transpose();
        }
        to.e[k] = P.dot(S * P);
        to.G.block<1, 4>(k, 3) = 2.0 * (S * P).transpose();
        H.block<4, 4>(3, 3) = 2.0 * S;
        const Matrix4 V = 2.0 * forms().bend[k];
        to.e[3 + k] = P.dot(V * P_s);
        to.G.block<1, 4>(3 + k, 3) = (V * P_s).transpose();
        to.G.block<1, 4>(3 + k, 7) = (V.transpose() * P).transpose();
        L.block<4, 4>(3, 7) = V;
        L.block<4, 4>(7, 3) = V.transpose();
    }
    for (int k = 0; k < 6; ++k) {  // of the quotient: e n = numerator, differentiated twice
        to.e[k] /= n;
        to.G.block<1, 4>(k, 3) -= 2.0 * to.e[k] * P.transpose();
        to.G.row(k) /= n;
        Hessian &H = to.H[k];
        H.block<11, 4>(0, 3) -= 2.0 * to.G.row(k).transpose() * P.transpose();
        H.block<4, 11>(3, 0) -= 2.0 * P * to.G.row(k);
        H.block<4, 4>(3, 3).diagonal().array() -= 2.0 * to.e[k];
        H /= n;
    }
}

}  // namespace nga
