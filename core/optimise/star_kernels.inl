// Included once per instruction set, with STRATA_KERNELS naming the table. Nothing but this file's own inline functions may be used here: a
// shared inline function compiled for one processor must not be linked into code for another.
#include "core/optimise/star_kernels.h"

namespace strata::star_kernels {
namespace {

using V = double __attribute__((vector_size(32)));
using Mask = long long __attribute__((vector_size(32)));

constexpr double kNorm = 0.19245008972987526;  // 3^(-3/2): u = 1 for the ideal corner
constexpr double kNothing = 1e-100;            // |T|^2 of lanes that hold no hex

inline V load(const double* p) {
  V v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}
inline void store(double* p, V v) { __builtin_memcpy(p, &v, sizeof v); }
inline V all(double a) { return V{a, a, a, a}; }
inline V root(V v) { return V{__builtin_sqrt(v[0]), __builtin_sqrt(v[1]), __builtin_sqrt(v[2]), __builtin_sqrt(v[3])}; }
inline V larger(V a, V b) { return a > b ? a : b; }
inline V smaller(V a, V b) { return a < b ? a : b; }
inline double sum(V v) { return (v[0] + v[1]) + (v[2] + v[3]); }
inline double largest(V v) {
  const double a = v[0] > v[1] ? v[0] : v[1], b = v[2] > v[3] ? v[2] : v[3];
  return a > b ? a : b;
}
inline double smallest(V v) {
  const double a = v[0] < v[1] ? v[0] : v[1], b = v[2] < v[3] ? v[2] : v[3];
  return a < b ? a : b;
}
inline int padded(int hexes) { return (hexes + kLanes - 1) / kLanes * kLanes; }

struct V3 {
  V x, y, z;
};
inline V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V3 operator*(V s, const V3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline V3 cross(const V3& a, const V3& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline V dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline V3 point(const Points& p, int j, int h) { return {load(p.x[j] + h), load(p.y[j] + h), load(p.z[j] + h)}; }

inline void put(Corners& c, int k, int h, V D, const V3& g, V N, const V3& n, V m) {
  store(c.D[k] + h, D);
  store(c.gx[k] + h, g.x), store(c.gy[k] + h, g.y), store(c.gz[k] + h, g.z);
  store(c.N[k] + h, N);
  store(c.nx[k] + h, n.x), store(c.ny[k] + h, n.y), store(c.nz[k] + h, n.z);
  store(c.m[k] + h, m);
}

double prepare(const Points& p, int hexes, Corners& c) {
  V lengths = all(0);
  const int n4 = padded(hexes);
  for (int h = 0; h < n4; h += kLanes) {
    const V3 o = point(p, 0, h);
    const V w[3] = {load(p.w[0] + h), load(p.w[1] + h), load(p.w[2] + h)};
    const V W = w[0] * w[1] * w[2];
    const V w2[3] = {w[0] * w[0], w[1] * w[1], w[2] * w[2]};
    const V3 e[3] = {point(p, 1, h), point(p, 2, h), point(p, 3, h)};
    const V3 f[3] = {point(p, 4, h), point(p, 5, h), point(p, 6, h)};
    const V3 r[3] = {e[0] - o, e[1] - o, e[2] - o};
    const V r2[3] = {dot(r[0], r[0]), dot(r[1], r[1]), dot(r[2], r[2])};
    V length = root(r2[0]) + root(r2[1]) + root(r2[2]);
    for (int lane = 0; lane < kLanes; ++lane)
      if (h + lane >= hexes) length[lane] = 0;
    lengths += length;
    const V3 n_own{-2 * (w2[0] * r[0].x + w2[1] * r[1].x + w2[2] * r[2].x), -2 * (w2[0] * r[0].y + w2[1] * r[1].y + w2[2] * r[2].y),
                   -2 * (w2[0] * r[0].z + w2[1] * r[1].z + w2[2] * r[2].z)};
    put(c, 0, h, W * dot(cross(r[0], r[1]), r[2]), (-W) * cross(r[1] - r[0], r[2] - r[0]), w2[0] * r2[0] + w2[1] * r2[1] + w2[2] * r2[2],
        n_own, w2[0] + w2[1] + w2[2]);
    for (int k = 0; k < 3; ++k) {
      const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
      const V3 a = f[k] - e[k];    // along axis k1
      const V3 b = f[k2] - e[k];   // along axis k2
      const V3 area = W * cross(a, b);
      put(c, 1 + k, h, dot(area, r[k]), {-area.x, -area.y, -area.z}, w2[k] * r2[k] + w2[k1] * dot(a, a) + w2[k2] * dot(b, b),
          (-2 * w2[k]) * r[k], w2[k]);
    }
  }
  for (int k = 0; k < 4; ++k)
    for (int h = hexes; h < n4; ++h) {
      c.D[k][h] = 1;
      c.N[k][h] = kNothing;
      c.gx[k][h] = c.gy[k][h] = c.gz[k][h] = c.nx[k][h] = c.ny[k][h] = c.nz[k][h] = c.m[k][h] = 0;
    }
  return sum(lengths);
}

inline V determinant(const Corners& c, int k, int h, V x, V y, V z) {
  return load(c.D[k] + h) + load(c.gx[k] + h) * x + load(c.gy[k] + h) * y + load(c.gz[k] + h) * z;
}
inline V norm2(const Corners& c, int k, int h, V x, V y, V z, V dd) {
  return larger(load(c.N[k] + h) + load(c.nx[k] + h) * x + load(c.ny[k] + h) * y + load(c.nz[k] + h) * z + load(c.m[k] + h) * dd,
                all(kNothing));
}
inline V raised(V u, int exponent) {
  V r = u;
  for (int i = 1; i < exponent; ++i) r *= u;
  return r;
}

Value value(const Corners& c, const double* freedom, int hexes, Place d, double eps2, int exponent) {
  const V x = all(d.x), y = all(d.y), z = all(d.z), dd = all(d.x * d.x + d.y * d.y + d.z * d.z), e2 = all(eps2);
  V energy = all(0), worst = all(0), least = all(kFree);
  const int n4 = padded(hexes);
  for (int k = 0; k < 4; ++k)
    for (int h = 0; h < n4; h += kLanes) {
      const V D = determinant(c, k, h, x, y, z);
      const V N = norm2(c, k, h, x, y, z, dd);
      least = smaller(least, D + load(freedom + h));
      V chi = D;
      if (eps2 > 0) {
        const V s = root(e2 + D * D);
        chi = D > 0 ? 0.5 * (D + s) : 0.5 * e2 / (s - D);  // the second form does not cancel
      }
      const V u = kNorm * N * root(N) / chi;
      worst = larger(worst, u);
      energy += raised(u, exponent);
    }
  return {sum(energy), largest(worst), smallest(least)};
}

template <bool kRegularised>
inline Value slopes_of(const Corners& c, int hexes, Place d, double eps2, int exponent, Slopes& out) {
  const V x = all(d.x), y = all(d.y), z = all(d.z), dd = all(d.x * d.x + d.y * d.y + d.z * d.z), e2 = all(eps2);
  const double ex = exponent;
  const V zero = all(0);
  V energy = zero, worst = zero, Gx = zero, Gy = zero, Gz = zero, Hxx = zero, Hyy = zero, Hzz = zero, Hxy = zero, Hxz = zero, Hyz = zero;
  const int n4 = padded(hexes);
  for (int k = 0; k < 4; ++k)
    for (int h = 0; h < n4; h += kLanes) {
      const V gx = load(c.gx[k] + h), gy = load(c.gy[k] + h), gz = load(c.gz[k] + h);
      const V m2 = 2 * load(c.m[k] + h);
      const V D = determinant(c, k, h, x, y, z);
      const V N = norm2(c, k, h, x, y, z, dd);
      V r, i_chi;  // r = chi' / chi
      if (kRegularised) {
        const V s = root(e2 + D * D);
        r = 1 / s;
        i_chi = D > 0 ? 2 / (D + s) : 2 * (s - D) / e2;
      } else {
        r = 1 / D;
        i_chi = r;
      }
      const V u = kNorm * N * root(N) * i_chi;
      const V E = raised(u, exponent), kE = ex * E;
      worst = larger(worst, u);
      energy += E;
      // a = grad ln N, b = grad ln chi, l = grad ln u = 3/2 a - b
      const V iN = 1 / N;
      const V ax = (load(c.nx[k] + h) + m2 * x) * iN, ay = (load(c.ny[k] + h) + m2 * y) * iN, az = (load(c.nz[k] + h) + m2 * z) * iN;
      const V bx = gx * r, by = gy * r, bz = gz * r;
      const V tx = 1.5 * ax, ty = 1.5 * ay, tz = 1.5 * az;
      const V lx = tx - bx, ly = ty - by, lz = tz - bz;
      Gx += kE * lx, Gy += kE * ly, Gz += kE * lz;
      const V iso = 1.5 * m2 * iN, klx = ex * lx, kly = ex * ly, klz = ex * lz;
      Hxx += kE * (klx * lx - tx * ax + bx * bx + iso);
      Hyy += kE * (kly * ly - ty * ay + by * by + iso);
      Hzz += kE * (klz * lz - tz * az + bz * bz + iso);
      Hxy += kE * (klx * ly - tx * ay + bx * by);
      Hxz += kE * (klx * lz - tx * az + bx * bz);
      Hyz += kE * (kly * lz - ty * az + by * bz);
    }
  out = {sum(Gx), sum(Gy), sum(Gz), sum(Hxx), sum(Hyy), sum(Hzz), sum(Hxy), sum(Hxz), sum(Hyz)};
  return {sum(energy), largest(worst), 0};
}

Value derivatives(const Corners& c, int hexes, Place d, double eps2, int exponent, Slopes& out) {
  return eps2 > 0 ? slopes_of<true>(c, hexes, d, eps2, exponent, out) : slopes_of<false>(c, hexes, d, eps2, exponent, out);
}

// Where an edge has no length the corner counts as flat.
inline V ratio(V D, V below) { return below > 0 ? D / below : all(0); }

double scaled_jacobian(const Points& p, const Corners& c, int hexes, Place d) {
  const V x = all(d.x), y = all(d.y), z = all(d.z);
  V least = all(1);
  const int n4 = padded(hexes);
  for (int h = 0; h < n4; h += kLanes) {
    const V3 o{load(p.x[0] + h) + x, load(p.y[0] + h) + y, load(p.z[0] + h) + z};
    const V W = load(p.w[0] + h) * load(p.w[1] + h) * load(p.w[2] + h);
    const V3 e[3] = {point(p, 1, h), point(p, 2, h), point(p, 3, h)};
    const V3 f[3] = {point(p, 4, h), point(p, 5, h), point(p, 6, h)};
    V product = W, worst = all(1);
    for (int k = 0; k < 3; ++k) {
      const V3 r = e[k] - o, a = f[k] - e[k], b = f[(k + 2) % 3] - e[k];
      const V length = root(dot(r, r));
      product *= length;
      worst = smaller(worst, ratio(determinant(c, 1 + k, h, x, y, z), W * root(dot(a, a) * dot(b, b)) * length));
    }
    worst = smaller(worst, ratio(determinant(c, 0, h, x, y, z), product));
    for (int lane = 0; lane < kLanes; ++lane)
      if (h + lane >= hexes) worst[lane] = 1;
    least = smaller(least, worst);
  }
  return smallest(least);
}

}  // namespace

const Table STRATA_KERNELS{prepare, value, derivatives, scaled_jacobian};

}  // namespace strata::star_kernels
