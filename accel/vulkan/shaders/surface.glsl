// The point of a hit, and where rays that leave it start: tracer/surface.cpp, which explains it, in the same arithmetic.
struct Surface {
  dvec3 point, normal;
  double offset;
};

const double kUnitRoundoff = 5.9604644775390625e-8LF;

double Length(dvec3 v) { return sqrt(Dot(v, v)); }
dvec3 Normalize(dvec3 v) { return v * (1 / Length(v)); }
double RoundingOffset(dvec3 point, dvec3 normal) {
  const dvec3 p = abs(point * normal);
  return (1 + 9.5367431640625e-7LF) * kUnitRoundoff * (p.x + p.y + p.z);
}
double CurvatureOffset(dvec3 point, double radius) {
  const double delta = kUnitRoundoff * Length(point);
  return min(delta, delta * delta / (2 * radius));
}
dvec3 PointAt(Ray ray, float t) { return dvec3(ray.org) + dvec3(ray.dir) * double(t); }
vec3 Position(uint vertex) { return push.picture.positions.at[vertex]; }

Surface OnTriangle(Hit hit) {
  const dvec3 p0 = dvec3(Position(push.picture.triangles.at[3 * hit.prim])),
              p1 = dvec3(Position(push.picture.triangles.at[3 * hit.prim + 1])),
              p2 = dvec3(Position(push.picture.triangles.at[3 * hit.prim + 2]));
  const dvec3 e1 = p1 - p0, e2 = p2 - p0, e3 = p2 - p1, across = Cross(e1, e2);
  const double twice_area = Length(across), u = double(hit.u), v = double(hit.v);
  Surface s;
  s.point = p0 * (1 - u - v) + p1 * u + p2 * v;
  s.normal = across * (1 / twice_area);
  const double square = max(Dot(e1, e1), max(Dot(e2, e2), Dot(e3, e3)));
  const double aspect = min(square / twice_area, 1024.0LF);
  s.offset = RoundingOffset(s.point, s.normal) + 2 * kUnitRoundoff * aspect * sqrt(square);
  return s;
}

Surface OnSphere(Sphere sphere, Ray ray, float t) {
  const dvec3 center = dvec3(sphere.center);
  const double radius = double(abs(sphere.radius));
  Surface s;
  s.normal = Normalize(PointAt(ray, t) - center);
  s.point = center + s.normal * radius;
  s.offset = RoundingOffset(s.point, s.normal) + CurvatureOffset(s.point, radius) + 4 * kUnitRoundoff * radius;
  return s;
}

Surface OnCone(Cone cone, Ray ray, float t) {
  const dvec3 base = dvec3(cone.base), axis = dvec3(cone.apex) - base;
  const double r0 = double(abs(cone.base_radius)), r1 = double(abs(cone.apex_radius)), len = Length(axis);
  const dvec3 along = axis * (1 / len), p = PointAt(ray, t) - base, dir = dvec3(ray.dir);
  const double height = clamp(Dot(p, along), 0.0LF, len), radius = r0 + (r1 - r0) * (height / len);
  dvec3 outward = p - along * Dot(p, along);
  if (Dot(outward, outward) == 0) outward = along * Dot(dir, along) - dir;
  if (Dot(outward, outward) == 0) outward = Cross(along, along.yzx);
  if (Dot(outward, outward) == 0) outward = dvec3(along.y, -along.x, 0);
  outward = Normalize(outward);
  Surface s;
  s.point = base + along * height + outward * radius;
  s.normal = Normalize(outward - along * ((r1 - r0) / len));
  s.offset = RoundingOffset(s.point, s.normal) + CurvatureOffset(s.point, radius) +
             5.684341886080802e-14LF * (len + max(r0, r1));
  return s;
}

Surface OnPolygon(Polygon polygon, Ray ray, float t) {
  const dvec3 p = PointAt(ray, t);
  const vec3 extent = polygon.hi - polygon.lo;
  Surface s;
  s.normal = Normalize(polygon.normal);
  s.point = p - s.normal * Dot(s.normal, p - polygon.center);
  s.offset = RoundingOffset(s.point, s.normal) + 2 * kUnitRoundoff * double(max(extent.x, max(extent.y, extent.z)));
  return s;
}

// The procedural primitive's index among its kind: 0 spheres, 1 cones, 2 polygons.
uint KindOf(uint prim, out uint index) {
  index = prim - push.scene.triangle_count;
  if (index < push.scene.sphere_count) return 0;
  index -= push.scene.sphere_count;
  if (index < push.scene.cone_count) return 1;
  index -= push.scene.cone_count;
  return 2;
}

Surface SurfaceAt(Ray ray, Hit hit) {
  if (!kProcedural || hit.prim < push.scene.triangle_count) return OnTriangle(hit);
  uint i;
  const uint kind = KindOf(hit.prim, i);
  if (kind == 0) return OnSphere(push.scene.spheres.at[i], ray, hit.t);
  if (kind == 1) return OnCone(push.scene.cones.at[i], ray, hit.t);
  return OnPolygon(push.scene.polygons.at[i], ray, hit.t);
}

void AddNormal(uint vertex, double weight, inout dvec3 sum) {
  const dvec3 n = dvec3(push.picture.normals.at[vertex]);
  const double square = Dot(n, n);
  if (square > 0) sum += n * (weight / sqrt(square));
}

// Mean value coordinates (Floater 2003), as MeanValueWeights() there.
void AddPolygonNormals(Polygon polygon, Surface surface, inout dvec3 sum) {
  const uint n = polygon.count;
  double before = 0;
  for (int turn = -1; turn < int(n); ++turn) {
    const uint i = turn < 0 ? n - 1 : uint(turn), next = (i + 1) % n;
    const uint va = push.scene.corners.at[polygon.first + i], vb = push.scene.corners.at[polygon.first + next];
    const dvec3 a = dvec3(Position(va)) - surface.point, b = dvec3(Position(vb)) - surface.point;
    const double to_a = Length(a), to_b = Length(b);
    if (to_a == 0) {
      sum = dvec3(0);
      AddNormal(va, 1, sum);
      return;
    }
    if (Dot(a, b) < 0 && Length(Cross(a, b)) <= 9.094947017729282e-13LF * to_a * to_b) {
      sum = dvec3(0);
      AddNormal(va, to_b, sum);
      AddNormal(vb, to_a, sum);
      return;
    }
    const double sine = Dot(Cross(a, b), surface.normal);
    const double after = sine == 0 ? 0 : (to_a * to_b - Dot(a, b)) / sine;
    if (turn >= 0) AddNormal(va, (before + after) / to_a, sum);
    before = after;
  }
}

dvec3 ShadingNormal(Hit hit, Surface surface) {
  dvec3 sum = dvec3(0);
  if (hit.prim < push.scene.triangle_count) {
    const double u = double(hit.u), v = double(hit.v);
    AddNormal(push.picture.triangles.at[3 * hit.prim], 1 - u - v, sum);
    AddNormal(push.picture.triangles.at[3 * hit.prim + 1], u, sum);
    AddNormal(push.picture.triangles.at[3 * hit.prim + 2], v, sum);
  } else if (kProcedural) {
    uint i;
    if (KindOf(hit.prim, i) == 2) AddPolygonNormals(push.scene.polygons.at[i], surface, sum);
  }
  const double square = Dot(sum, sum);
  return square > 0 ? sum * (1 / sqrt(square)) : surface.normal;
}
