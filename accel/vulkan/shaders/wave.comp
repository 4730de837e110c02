// One wave of a picture: each ray finds its hit, asks for shadows, adds its light to its sample, and puts the rays that
// it sends on into the queue of the next wave. tracer/shader.cpp and tracer/shading.h have the model.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "picture.glsl"
#include "procedural.glsl"
#include "surface.glsl"

layout(local_size_x = 64) in;

const float kShadowFar = 1 - 9.5367431640625e-7;

uint PrimOf(uint instance, uint index) { return push.scene.first_prims.at[instance] + index; }
bool IsBlack(vec3 color) { return color == vec3(0); }

Hit ClosestHit(Ray ray) {
  const RayQuery q = RayQuery(ray, kNone, kNone);
  rayQueryEXT look;
  rayQueryInitializeEXT(look, accelerationStructureEXT(push.tlas), gl_RayFlagsOpaqueEXT, 0xFF, ray.org, kMinNormal,
                        ray.dir, min(ray.tfar, kMaxFloat));
  while (rayQueryProceedEXT(look)) {
    if (!kProcedural || rayQueryGetIntersectionTypeEXT(look, false) == gl_RayQueryCandidateIntersectionTriangleEXT)
      continue;
    float t;
    const uint prim = PrimOf(rayQueryGetIntersectionInstanceCustomIndexEXT(look, false),
                             rayQueryGetIntersectionPrimitiveIndexEXT(look, false));
    if (!HitProcedural(prim, q, t)) continue;
    if (rayQueryGetIntersectionTypeEXT(look, true) == gl_RayQueryCommittedIntersectionNoneEXT ||
        t < rayQueryGetIntersectionTEXT(look, true))
      rayQueryGenerateIntersectionEXT(look, t);
  }
  const uint type = rayQueryGetIntersectionTypeEXT(look, true);
  if (type == gl_RayQueryCommittedIntersectionNoneEXT) return Hit(ray.tfar, 0, 0, kNone);
  vec2 uv = vec2(0);
  if (type == gl_RayQueryCommittedIntersectionTriangleEXT) uv = rayQueryGetIntersectionBarycentricsEXT(look, true);
  return Hit(rayQueryGetIntersectionTEXT(look, true), uv.x, uv.y,
             PrimOf(rayQueryGetIntersectionInstanceCustomIndexEXT(look, true),
                    rayQueryGetIntersectionPrimitiveIndexEXT(look, true)));
}

vec3 TransmitOf(uint prim) { return push.picture.materials.at[push.picture.materials_of.at[prim]].transmit; }

// What reaches the end of the ray: a product over all that it passes, in whatever order these come. Structures are
// built such that no triangle comes twice.
vec3 Visible(Ray ray) {
  const bool gathers = push.picture.gathers;
  vec3 visible = vec3(1);
  rayQueryEXT look;
  rayQueryInitializeEXT(look, accelerationStructureEXT(push.tlas),
                        gathers ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsOpaqueEXT | gl_RayFlagsTerminateOnFirstHitEXT,
                        0xFF, ray.org, kMinNormal, ray.dir, min(ray.tfar, kMaxFloat));
  while (rayQueryProceedEXT(look)) {
    const uint prim = PrimOf(rayQueryGetIntersectionInstanceCustomIndexEXT(look, false),
                             rayQueryGetIntersectionPrimitiveIndexEXT(look, false));
    if (rayQueryGetIntersectionTypeEXT(look, false) == gl_RayQueryCandidateIntersectionTriangleEXT) {
      const float t = rayQueryGetIntersectionTEXT(look, false);
      if (!(t > ray.tnear && t <= ray.tfar)) continue;
      if (gathers) visible *= TransmitOf(prim);
    } else if (kProcedural) {
      // A curved primitive is met twice.
      Ray rest = ray;
      float t;
      for (int times = 0; times < 2 && IntersectProcedural(prim, rest, t); ++times, rest.tnear = t)
        visible *= gathers ? TransmitOf(prim) : vec3(0);
    }
    if (IsBlack(visible)) return visible;
  }
  return rayQueryGetIntersectionTypeEXT(look, true) == gl_RayQueryCommittedIntersectionNoneEXT ? visible : vec3(0);
}

// In fixed point, so that the sum does not depend on the order of its terms.
void AddLight(uint sample_index, vec3 color) {
  for (int k = 0; k < 3; ++k) {
    const float value = clamp(color[k], 0.0, 4294967040.0);  // NaN becomes 0
    const float whole = floor(value);
    const uint above = uint(whole), below = uint((value - whole) * 4294967296.0);
    const uint at = 6 * sample_index + 2 * k;
    const uint before = atomicAdd(push.picture.sums.at[at], below);
    const uint carry = before + below < before ? 1 : 0;
    if (above + carry != 0) atomicAdd(push.picture.sums.at[at + 1], above + carry);
  }
}

vec3 Start(Surface surface, double side) {
  return vec3(surface.point + surface.normal * (side < 0 ? -surface.offset : surface.offset));
}
bool IsFinite(vec3 v) { return !any(isnan(v)) && !any(isinf(v)); }
bool IsValid(Ray ray) { return IsFinite(ray.org) && IsFinite(ray.dir) && ray.dir != vec3(0); }

double Power(double base, float exponent) {
  if (exponent < 0 || exponent >= 65536 || floor(exponent) != exponent) return double(pow(float(base), exponent));
  double result = 1;
  for (uint bits = uint(exponent); bits != 0; bits >>= 1, base *= base)
    if ((bits & 1) != 0) result *= base;
  return result;
}
dvec3 Mirrored(dvec3 view, dvec3 normal) { return view + normal * (2 * -Dot(normal, view)); }
bool Refract(dvec3 view, dvec3 normal, double eta, out dvec3 refracted) {
  const double cosine = -Dot(normal, view), square = 1 - eta * eta * (1 - cosine * cosine);
  if (square < 0) return false;
  refracted = Normalize(view * eta + normal * (eta * cosine - sqrt(square)));
  return true;
}
double FresnelReflectance(double cosine, double eta) {
  const double square = eta * eta * (1 - cosine * cosine);
  if (square >= 1) return 1;
  const double other = sqrt(1 - square);
  const double across = (eta * cosine - other) / (eta * cosine + other),
               along = (cosine - eta * other) / (cosine + eta * other);
  return 0.5LF * (across * across + along * along);
}

// What falloff, cone and range leave of a light.
double ShareOf(Light light, dvec3 to_light, double len) {
  double share = light.falloff ? 1 / (len * len) : 1;
  if (light.kind == 2) {
    const double cosine = -Dot(to_light, dvec3(light.direction)) / len, inner = double(light.cos_inner),
                 outer = double(light.cos_outer);
    const double ramp = cosine >= inner ? 1 : cosine <= outer ? 0 : (cosine - outer) / (inner - outer);
    share *= ramp * ramp;
  }
  if (!isinf(light.range)) {
    const double ratio = len / double(light.range), fourth = ratio * ratio * ratio * ratio;
    share *= clamp(1 - fourth, 0.0LF, 1.0LF);
  }
  return share;
}

struct Turn {
  Path path;
  Material material;
  Surface surface;
  dvec3 view, facing, normal;
  double side;
};

void AskLights(Turn turn) {
  const dvec3 mirrored = Mirrored(turn.view, turn.normal);
  vec3 sum = vec3(0);
  uint asked = 0, blocked = 0;
  for (uint i = 0; i < push.picture.light_count; ++i) {
    const Light light = push.picture.lights.at[i];
    const bool directional = light.kind == 1;
    const dvec3 to_light = directional ? -dvec3(light.direction) : dvec3(light.position) - turn.surface.point;
    const double len = directional ? 1 : Length(to_light), share = directional ? 1 : ShareOf(light, to_light, len);
    const double cosine = Dot(turn.normal, to_light) / len;
    if (!(cosine > 0) || share == 0) continue;
    if (push.picture.smooth_normals && !(Dot(turn.facing, to_light) > 0)) continue;
    vec3 color = turn.material.diffuse * float(cosine);
    if (!IsBlack(turn.material.specular)) {
      const double phong = Dot(mirrored, to_light) / len;
      if (phong > 0) color += turn.material.specular * float(Power(phong, turn.material.shininess));
    }
    color *= light.intensity * float(share);
    Ray ray;
    ray.org = Start(turn.surface, turn.side);
    ray.tnear = 0;
    ray.dir = directional ? vec3(to_light) : light.position - ray.org;
    ray.tfar = directional ? kMaxFloat : kShadowFar;
    ++asked;
    const vec3 visible = IsValid(ray) ? Visible(ray) : vec3(1);
    if (IsBlack(visible)) {
      ++blocked;
    } else {
      sum += turn.path.weight * color * visible;
    }
  }
  AddLight(turn.path.sample_index, sum);
  atomicAdd(push.picture.waves.at[push.wave].shadow, asked);
  atomicAdd(push.picture.waves.at[push.wave].blocked, blocked);
}

// Into the queue of the next wave. What does not fit is counted: the host sees it, and begins again with less.
void Send(Turn turn, vec3 weight, dvec3 dir, bool refracts) {
  weight *= turn.path.weight;
  if (max(weight.x, max(weight.y, weight.z)) < push.picture.min_contribution) return;
  Path next;
  next.weight = weight;
  next.sample_index = turn.path.sample_index;
  next.ray = Ray(Start(turn.surface, refracts ? -turn.side : turn.side), 0, vec3(dir), kMaxFloat);
  const uint wave = push.wave + 1, at = atomicAdd(push.picture.waves.at[wave].rays, 1);
  if (refracts) {
    atomicAdd(push.picture.waves.at[wave].refractions, 1);
  } else {
    atomicAdd(push.picture.waves.at[wave].reflections, 1);
  }
  if (at < push.picture.capacity) push.picture.paths[wave & 1].at[at] = next;
}

void SendOn(Turn turn) {
  const Material m = turn.material;
  const bool transmits = !IsBlack(m.transmit), smooth_normals = push.picture.smooth_normals;
  const bool fresnel = push.picture.fresnel == 2 || (push.picture.fresnel == 0 && m.fresnel);
  const bool spectral = !m.thin && !IsBlack(m.dispersion);
  vec3 reflected = m.reflect;
  for (int channel = 0; transmits && channel < (spectral ? 3 : 1); ++channel) {
    vec3 weight = m.transmit;
    double ior = double(m.ior);
    if (spectral) {
      weight = vec3(0);
      weight[channel] = m.transmit[channel];
      if (IsBlack(weight * turn.path.weight)) continue;
      ior += double(m.dispersion[channel]);
    }
    dvec3 dir = turn.view, normal = turn.normal;
    const double eta = turn.side < 0 && !m.thin ? ior : 1 / ior;
    if (!m.thin) {
      bool passes = Refract(turn.view, normal, eta, dir);
      if (smooth_normals && passes && Dot(dir, turn.facing) > 0) {
        normal = turn.facing;
        passes = Refract(turn.view, normal, eta, dir);
      }
      if (!passes) {
        reflected += weight;
        continue;
      }
    }
    if (fresnel) {
      const float mirrored = float(FresnelReflectance(-Dot(normal, turn.view), eta));
      reflected += weight * mirrored;
      weight *= 1 - mirrored;
      if (IsBlack(weight)) continue;
    }
    Send(turn, weight, dir, true);
  }
  if (IsBlack(reflected)) return;
  dvec3 mirrored = Mirrored(turn.view, turn.normal);
  if (smooth_normals && Dot(mirrored, turn.facing) < 0) mirrored = Mirrored(turn.view, turn.facing);
  Send(turn, reflected, mirrored, false);
}

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= min(push.picture.waves.at[push.wave].rays, push.picture.capacity)) return;
  Turn turn;
  turn.path = push.picture.paths[push.wave & 1].at[i];
  const Ray ray = turn.path.ray;
  Hit hit = Hit(0, 0, 0, kNone);
  if (IsValid(ray)) hit = ClosestHit(ray);
  if (hit.prim == kNone) {
    AddLight(turn.path.sample_index, turn.path.weight * push.picture.background);
    return;
  }
  atomicAdd(push.picture.waves.at[push.wave].hits, 1);
  turn.material = push.picture.materials.at[push.picture.materials_of.at[hit.prim]];
  turn.surface = SurfaceAt(ray, hit);
  turn.view = Normalize(dvec3(ray.dir));
  turn.side = Dot(turn.surface.normal, turn.view) > 0 ? -1 : 1;
  turn.facing = turn.normal = turn.surface.normal * turn.side;
  if (push.picture.smooth_normals) {
    const dvec3 stored = ShadingNormal(hit, turn.surface), front = Dot(stored, turn.facing) < 0 ? -stored : stored;
    if (Dot(front, turn.view) < 0) turn.normal = front;
  }
  AddLight(turn.path.sample_index,
           turn.path.weight * (turn.material.emission + push.picture.ambient * turn.material.diffuse));
  if (push.picture.shadow_rays) AskLights(turn);
  if (push.wave < push.picture.max_depth && !(IsBlack(turn.material.reflect) && IsBlack(turn.material.transmit)))
    SendOn(turn);
}
