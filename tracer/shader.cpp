#include "tracer/shader.h"

#include <cmath>
#include <limits>

#include "tracer/camera_rays.h"
#include "tracer/shading.h"

namespace raybench {
namespace {

constexpr float kShadowFar =
    1 - 0x1p-20f;  // t of the light is 1 up to rounding: what carries the light is no blocker
constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

Shader::Shader(const Scene& scene, const TraceOptions& options)
    : scene_(scene),
      options_(options),
      spd_(options.rules == TraceRules::kSpd),
      needs_(options.all_needs ? AllNeedsOf(scene) : NeedsOf(scene)),
      has_holes_(needs_.alpha && !spd_),  // by kSpd everything blocks light
      gathers_(needs_.transmittance && !spd_),
      textures_(scene, needs_.textured),
      tnear_(spd_ ? 1e-6f : 0),
      cure_size_(std::ldexp(double(options.self_intersection_size), scene.scale_exponent)) {}

Shader::Look Shader::LookOf(const Material& material, const rb_hit& hit) const {
  Look look{material.diffuse, material.reflect, material.transmit, material.emission};
  if (!needs_.textures || hit.prim >= scene_.triangles.size()) return look;
  if (material.base_color_texture < 0 && material.emission_texture < 0) return look;
  const Vec2f uv = UvAt(scene_, hit);
  if (material.base_color_texture >= 0) {
    const Vec3f color = textures_.At(material.base_color_texture, uv).color;
    look.diffuse = look.diffuse * color;
    look.reflect = look.reflect * color;
    look.transmit = look.transmit * color;
  }
  if (material.emission_texture >= 0)
    look.emission = look.emission * textures_.At(material.emission_texture, uv).color;
  return look;
}

bool Shader::IsHole(const rb_hit& hit) const {
  const Material& material = MaterialOf(hit);
  if (material.alpha_mode != AlphaMode::kMask) return false;
  float alpha = material.alpha;
  if (needs_.textures && hit.prim < scene_.triangles.size() && material.base_color_texture >= 0)
    alpha *= textures_.At(material.base_color_texture, UvAt(scene_, hit)).alpha;
  return alpha < material.alpha_cutoff;
}

Vec3f Shader::Transmittance(const rb_hit& hit) const {
  if (has_holes_ && IsHole(hit)) return {1, 1, 1};
  const Material& material = MaterialOf(hit);
  return IsBlack(material.transmit) ? material.transmit : LookOf(material, hit).transmit;
}

/// A hit on its way through the shader, and the path that it belongs to.
struct Shader::Turn {
  const Path& path;
  uint32_t path_index, prim;
  const Material& material;
  SurfacePoint surface;
  Vec3d view;        ///< unit, towards the surface
  double side;       ///< of the surface that the eye is on: 1 or -1, where its geometric normal points away
  Vec3d facing;      ///< geometric normal, towards the eye
  Vec3d normal;      ///< that shading goes by, towards the eye
  Vec3d lit_normal;  ///< whose front lights shine on: `normal`; by kSpd as it is stored
  Departure front;   ///< of rays on the eye's side
};

inline Departure Shader::Leave(const Turn& turn, double side) const {
  const SelfIntersection cure = options_.self_intersection;
  if (cure == SelfIntersection::kErrorBound) return {turn.surface.Origin(side)};
  bool flat = false;
  if (cure == SelfIntersection::kSkip) {
    const PrimKind kind = scene_.Locate(turn.prim).kind;
    flat = kind == PrimKind::kTriangle || kind == PrimKind::kPolygon;
  }
  return Depart(turn.surface, side, cure, cure_size_, turn.prim, flat);
}

inline rb_ray Shader::RayFrom(const Departure& departure, Vec3f dir, float tfar) const {
  float tnear = tnear_;
  if (departure.distance > 0) tnear = std::max(tnear, float(departure.distance / Length(ToDouble(dir))));
  return MakeRay(departure.org, tnear, dir, tfar);
}

Vec3f Shader::Shade(const Path& path, uint32_t path_index, const rb_ray& ray, const rb_hit& hit, bool last,
                    ShadeOutput& out) const {
  const Material& material = MaterialOf(hit);
  Turn turn{path, path_index, hit.prim, material, SurfaceAt(scene_, ray, hit), {}, 1, {}, {}, {}, {}};
  const Vec3d geometric = turn.surface.normal;
  turn.view = Normalize(ToDouble(LoadVec3(ray.dir)));
  turn.side = Dot(geometric, turn.view) > 0 ? -1 : 1;
  turn.facing = turn.normal = geometric * turn.side;
  turn.lit_normal = spd_ ? geometric : turn.facing;
  if (needs_.smooth_normals) {
    const Vec3d stored = ShadingNormal(scene_, hit, turn.surface);
    if (spd_) {
      turn.lit_normal = stored;
      turn.normal = Dot(stored, turn.view) > 0 ? -stored : stored;
    } else {
      const Vec3d front = Dot(stored, turn.facing) < 0 ? -stored : stored;
      // Behind the smooth surface's silhouette the flat one stands for it.
      if (Dot(front, turn.view) < 0) turn.normal = turn.lit_normal = front;
    }
  }
  turn.front = Leave(turn, turn.side);

  const Look look = LookOf(material, hit);
  if (spd_ || needs_.shadow_rays) SendToLights(turn, look, out);
  if (!last && !(IsBlack(look.reflect) && IsBlack(look.transmit))) SendOn(turn, look, out);
  return path.weight * (look.emission + scene_.ambient * look.diffuse);
}

void Shader::SendToLights(const Turn& turn, const Look& look, ShadeOutput& out) const {
  const Material& material = turn.material;
  const Vec3d mirrored = Mirrored(turn.view, turn.normal);
  for (const Light& light : scene_.lights) {
    const auto [to_light, distance, share] = LightAt(light, turn.surface.point);
    const double cosine = Dot(turn.lit_normal, to_light) / distance;
    if (!(cosine > 0) || share == 0) continue;
    // Nothing shines through the surface itself, whatever its vertex normals say.
    if (needs_.smooth_normals && !spd_ && !(Dot(turn.facing, to_light) > 0)) continue;
    Vec3f color = look.diffuse * float(cosine);
    if (!IsBlack(material.specular)) {
      const double phong = Dot(mirrored, to_light) / distance;
      if (phong > 0) color = color + material.specular * float(Power(phong, double(material.shininess)));
    }
    color = color * light.intensity * float(share);

    Departure departure = turn.front;
    if (spd_ && Dot(turn.facing, to_light) < 0) departure = Leave(turn, -turn.side);
    const bool directional = light.kind == LightKind::kDirectional;
    AddTo(out.shadow, departure,
          RayFrom(departure, directional ? ToFloat(to_light) : light.position - departure.org,
                  directional ? kInfinity : kShadowFar));
    out.lit.push_back({turn.path.weight * color, turn.path_index});
  }
}

void Shader::SendPath(RayKind kind, const Turn& turn, Vec3f weight, Vec3d dir, bool far_side,
                      ShadeOutput& out) const {
  weight = turn.path.weight * weight;
  if (!spd_ && std::max({weight.x, weight.y, weight.z}) < options_.min_contribution) return;
  if (spd_) far_side = Dot(turn.facing, dir) < 0;
  const Departure departure = far_side ? Leave(turn, -turn.side) : turn.front;
  Batch& batch = out.next.batches[kind];
  out.next.paths.push_back({weight, turn.path.sample, kind, uint32_t(batch.rays.size()) & 0x7FFFFFFFu});
  AddTo(batch, departure, RayFrom(departure, ToFloat(dir), kInfinity));
}

void Shader::SendOn(const Turn& turn, const Look& look, ShadeOutput& out) const {
  const Material& material = turn.material;
  const bool transmits = !IsBlack(look.transmit), smooth = needs_.smooth_normals && !spd_;
  const bool fresnel = !spd_ && (options_.fresnel == FresnelMode::kOn ||
                                 (options_.fresnel == FresnelMode::kMaterial && material.fresnel));
  const bool spectral = !spd_ && !material.thin && !IsBlack(material.dispersion);

  Vec3f reflect = look.reflect;
  struct {
    Vec3d dir;
    Vec3f weight;
  } refracted[3];
  int count = 0;
  for (int channel = 0; transmits && channel < (spectral ? 3 : 1); ++channel) {
    Vec3f weight = look.transmit;
    double ior = material.ior;
    if (spectral) {
      weight = {0, 0, 0};
      weight[channel] = look.transmit[channel];
      if (IsBlack(weight * turn.path.weight)) continue;
      ior += double(material.dispersion[channel]);
    }
    Vec3d dir = turn.view, normal = turn.normal;
    const double eta = turn.side < 0 && !material.thin ? ior : 1 / ior;
    if (!material.thin) {
      bool passes = Refract(turn.view, normal, eta, dir);
      if (smooth && passes && Dot(dir, turn.facing) > 0)  // the vertex normals would bend it back
        passes = Refract(turn.view, normal = turn.facing, eta, dir);
      if (!passes) {  // total internal reflection: the mirror ray takes it all
        reflect = reflect + weight;
        continue;
      }
    }
    if (fresnel) {
      const auto mirrored = float(FresnelReflectance(-Dot(normal, turn.view), eta));
      reflect = reflect + weight * mirrored;
      weight = weight * (1 - mirrored);
      if (IsBlack(weight)) continue;
    }
    refracted[count++] = {dir, weight};
  }

  if (!IsBlack(reflect) || (spd_ && transmits)) {
    Vec3d mirrored = Mirrored(turn.view, turn.normal);
    if (smooth && Dot(mirrored, turn.facing) < 0) mirrored = Mirrored(turn.view, turn.facing);
    SendPath(kReflection, turn, reflect, mirrored, false, out);
  }
  for (int i = 0; i < count; ++i)
    SendPath(kRefraction, turn, refracted[i].weight, refracted[i].dir, true, out);
}

}  // namespace raybench
