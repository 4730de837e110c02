// Procedural primitives: the tests of datasets/scene/procedural.cpp, which explains them, in the same arithmetic
// (doubles, none of them fused), so that answers differ from the host's in rounding at most.

double Dot(dvec3 a, dvec3 b) {
  precise double d = a.x * b.x + a.y * b.y + a.z * b.z;
  return d;
}
dvec3 Cross(dvec3 a, dvec3 b) {
  precise dvec3 c = dvec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
  return c;
}
bool IsNegative(double x) { return (unpackDouble2x32(x).y >> 31) != 0; }
double CopySign(double size, double of) { return IsNegative(of) ? -size : size; }
bool InInterval(Ray ray, float t) { return t > ray.tnear && t <= ray.tfar && t <= kMaxFloat; }

bool IntersectSphere(Sphere sphere, Ray ray, out float t) {
  precise const dvec3 d = dvec3(ray.dir), f = dvec3(ray.org) - dvec3(sphere.center);
  precise const double r2 = double(sphere.radius) * sphere.radius;
  const double a = Dot(d, d), b = -Dot(f, d);
  precise const dvec3 nearest = f + d * (b / a);
  precise const double discriminant = r2 - Dot(nearest, nearest);
  if (!(discriminant >= 0)) return false;
  precise const double q = b + CopySign(sqrt(a * discriminant), b);
  precise double t0 = q / a, t1 = q == 0 ? t0 : (Dot(f, f) - r2) / q;
  if (t0 > t1) {
    const double swapped = t0;
    t0 = t1, t1 = swapped;
  }
  t = float(t0);
  if (sphere.radius > 0 && InInterval(ray, t)) return true;
  t = float(t1);
  return InInterval(ray, t);
}

// Takes one root of a cone into t, if it lies between the rims.
void TakeRoot(Ray ray, double at, double along, bool is_leaving, bool inside_only, double square, double size,
              inout bool found, inout float t) {
  const float candidate = float(at);
  if (!InInterval(ray, candidate) || (inside_only && !is_leaving) || (found && candidate >= t)) return;
  precise const double beyond = abs(along) - 0.5LF;
  if (!(beyond <= 0) && !(beyond * beyond * square <= 1.2621774483536189e-29LF * size)) return;  // 2^-96
  t = candidate;
  found = true;
}

bool IntersectCone(Cone cone, Ray ray, out float t) {
  precise const dvec3 base = dvec3(cone.base), apex = dvec3(cone.apex), middle = (base + apex) * 0.5LF, axis = apex - base;
  const double square = Dot(axis, axis);
  precise const double mean = 0.5LF * (double(cone.base_radius) + double(cone.apex_radius)),
                       widening = double(cone.apex_radius) - double(cone.base_radius);
  precise const dvec3 dir = dvec3(ray.dir), from = dvec3(ray.org) - middle;
  precise const double shift = -Dot(from, dir) / Dot(dir, dir);
  precise const dvec3 nearest = from + dir * shift;
  precise const double s0 = Dot(nearest, axis) / square, s1 = Dot(dir, axis) / square;
  precise const dvec3 d = dir - axis * s1, q = nearest - axis * s0;
  precise const double r0 = mean + widening * s0, r1 = widening * s1;
  precise const dvec3 turned = d * r0 - q * r1, moment = Cross(d, q);
  precise const double discriminant = Dot(turned, turned) - Dot(moment, moment);
  if (!(discriminant >= 0)) return false;
  precise const double a = Dot(d, d) - r1 * r1, b = Dot(q, d) - r0 * r1, c = Dot(q, q) - r0 * r0;
  precise const double sum = -(b + CopySign(sqrt(discriminant), b));
  precise const double size = Dot(from, from) + square + mean * mean;
  const bool inside_only = cone.base_radius < 0 || cone.apex_radius < 0;
  bool found = false;
  precise double root = sum / a;
  TakeRoot(ray, shift + root, s0 + root * s1, IsNegative(b), inside_only, square, size, found, t);
  root = c / sum;
  TakeRoot(ray, shift + root, s0 + root * s1, !IsNegative(b), inside_only, square, size, found, t);
  return found;
}

// The space where the ray is the z axis (RayShear of accel/ray/triangle.h).
struct Shear {
  int kx, ky, kz;
  float sx, sy;
  bool in_double;
};
Shear ShearOf(Ray ray) {
  const vec3 size = abs(ray.dir);
  Shear s;
  const int of_xy = size.x > size.y ? 0 : 1;
  s.kz = max(size.x, size.y) > size.z ? of_xy : 2;
  s.kx = (s.kz + 1) % 3;
  s.ky = (s.kz + 2) % 3;
  precise const float sx = ray.dir[s.kx] / ray.dir[s.kz], sy = ray.dir[s.ky] / ray.dir[s.kz];
  s.sx = sx, s.sy = sy;
  const vec3 far = abs(ray.org);
  s.in_double = (abs(sx) < kMinNormal && ray.dir[s.kx] != 0) || (abs(sy) < kMinNormal && ray.dir[s.ky] != 0) ||
                max(far.x, max(far.y, far.z)) > 8589934592.0;
  return s;
}
double Across(float a, float slope, float z) {
  precise const float product = slope * z;
  if (max(abs(a), abs(product)) < kMinNormal) {
    precise const double exact = double(a) - double(slope) * double(z);
    return exact;
  }
  precise const float across = a - product;
  return double(across);
}
dvec3 Sheared(Shear s, Ray ray, vec3 p) {
  if (s.in_double) {
    precise const dvec3 a = dvec3(p) - dvec3(ray.org), d = dvec3(ray.dir);
    precise const dvec3 in_double =
        dvec3(a[s.kx] * d[s.kz] - d[s.kx] * a[s.kz], a[s.ky] * d[s.kz] - d[s.ky] * a[s.kz], a[s.kz]);
    return in_double;
  }
  precise const vec3 a = p - ray.org;
  return dvec3(Across(a[s.kx], s.sx, a[s.kz]), Across(a[s.ky], s.sy, a[s.kz]), double(a[s.kz]));
}

bool IntersectPolygon(Polygon polygon, Ray ray, out float t) {
  precise float tnear = -1.0 / 0.0, tfar = 1.0 / 0.0;
  for (int a = 0; a < 3; ++a) {
    const bool is_negative = (floatBitsToUint(ray.dir[a]) >> 31) != 0;
    precise const float inverse = 1 / ray.dir[a];
    const float near_scale = clamp(inverse, -kMaxFloat, kMaxFloat);
    precise const float far_scale = inverse * (1 + 1.9073486328125e-6);
    precise const float n = ((is_negative ? polygon.hi[a] : polygon.lo[a]) - ray.org[a]) * near_scale;
    precise const float f = ((is_negative ? polygon.lo[a] : polygon.hi[a]) - ray.org[a]) * far_scale;
    tnear = n > tnear ? n : tnear;
    tfar = f < tfar ? f : tfar;
  }
  if (!(tnear <= tfar && tfar > ray.tnear && tnear <= ray.tfar)) return false;

  const Shear shear = ShearOf(ray);
  const uint last = polygon.first + polygon.count;
  dvec3 a = Sheared(shear, ray, push.scene.positions.at[push.scene.corners.at[last - 1]]);
  double zmin = a.z, zmax = a.z;
  bool is_inside = false;
  for (uint i = polygon.first; i < last; ++i) {
    const dvec3 b = Sheared(shear, ray, push.scene.positions.at[push.scene.corners.at[i]]);
    zmin = min(zmin, b.z), zmax = max(zmax, b.z);
    if ((a.y > 0) != (b.y > 0)) {
      precise const double edge = a.x * b.y - a.y * b.x;
      is_inside = is_inside != (b.y > 0 ? edge > 0 : edge < 0);
    }
    a = b;
  }
  if (!is_inside) return false;
  const double toward = Dot(polygon.normal, dvec3(ray.dir));
  precise const dvec3 to_center = polygon.center - dvec3(ray.org);
  const double away = Dot(polygon.normal, to_center), main = double(ray.dir[shear.kz]);
  precise const double z0 = zmin / main, z1 = zmax / main;
  const double t0 = min(z0, z1), t1 = max(z0, z1);
  precise const double between = toward != 0 ? clamp(away / toward, t0, t1) : t0;
  t = clamp(float(between), tnear, tfar);
  return InInterval(ray, t);
}

bool IntersectProcedural(uint prim, Ray ray, out float t) {
  uint i = prim - push.scene.triangle_count;
  if (i < push.scene.sphere_count) return IntersectSphere(push.scene.spheres.at[i], ray, t);
  i -= push.scene.sphere_count;
  if (i < push.scene.cone_count) return IntersectCone(push.scene.cones.at[i], ray, t);
  return IntersectPolygon(push.scene.polygons.at[i - push.scene.cone_count], ray, t);
}

// The nearest hit of the primitive that counts. As in accel/ray/primitive.h a hit at t == tnear must get through to
// where that is decided, and if it does not count it must not hide the far side.
bool HitProcedural(uint prim, RayQuery q, out float t) {
  if (kFiltered && q.after != kNone && prim > q.after) {
    Ray before = q.ray;
    before.tnear = q.ray.tnear * (1 - 9.5367431640625e-7) - kMinNormal;
    if (IntersectProcedural(prim, before, t) && Counts(q, t, prim)) return true;
  }
  return IntersectProcedural(prim, q.ray, t) && Counts(q, t, prim);
}
