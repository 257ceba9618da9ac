// The arithmetic of stars on plain arrays, four hexes at a time. Compiled twice, for any processor and for AVX2, by the same operations in
// the same order (no fused ones), so that every machine gets the same bytes. Private to the room.
#pragma once

namespace strata::star_kernels {

inline constexpr int kLanes = 4;
inline constexpr int kMaxHexes = 48;  // a multiple of the lanes

// What a star is made of, hexes side by side: the vertex, then its six others in pattern order (star.h).
struct Points {
  alignas(64) double x[7][kMaxHexes];
  double y[7][kMaxHexes];
  double z[7][kMaxHexes];
  double w[3][kMaxHexes];        // inverse target lengths along e0 e1 e2
  double freedom[kMaxHexes];     // 0: determinants must stay positive; kFree: they need not
};
inline constexpr double kFree = 1e300;

// Of the four corners of each hex that change with the vertex: det T = D + g.d, |T|^2 = N + n.d + m |d|^2.
struct Corners {
  alignas(64) double D[4][kMaxHexes];
  double gx[4][kMaxHexes], gy[4][kMaxHexes], gz[4][kMaxHexes];
  double N[4][kMaxHexes];
  double nx[4][kMaxHexes], ny[4][kMaxHexes], nz[4][kMaxHexes];
  double m[4][kMaxHexes];
};

struct Place {
  double x, y, z;
};
struct Value {
  double energy;
  double worst;         // largest u
  double least_bound;   // smallest determinant of the hexes that must stay positive
};
struct Slopes {
  double gx, gy, gz;
  double hxx, hyy, hzz, hxy, hxz, hyz;
};

struct Table {
  // Fills the corners of `hexes` hexes, and harmless ones up to the next multiple of the lanes. Returns the sum of the edge lengths at the
  // vertex.
  double (*prepare)(const Points& points, int hexes, Corners& corners);
  // Sum of u^exponent with u = (|T|^2 / 3)^(3/2) / chi(det T) at the place d (star.h); chi(D) = (D + sqrt(D^2 + eps2)) / 2, D where eps2 = 0.
  Value (*value)(const Corners& corners, const double* freedom, int hexes, Place d, double eps2, int exponent);
  // The same with gradient and positive definite Hessian.
  Value (*derivatives)(const Corners& corners, int hexes, Place d, double eps2, int exponent, Slopes& slopes);
  // Smallest scaled Jacobian of the corners.
  double (*scaled_jacobian)(const Points& points, const Corners& corners, int hexes, Place d);
};

extern const Table kPlain;
#ifdef STRATA_AVX2
extern const Table kAvx2;
#endif
// The fastest this machine can run.
const Table& table();

}  // namespace strata::star_kernels
