/* A picture that a device traces by itself, wave after wave, so that no ray returns to the host: an optional
 * function of a plugin beside its structures. Compiles as C11 and as C++20.
 *
 * The model is that of tracer/shading.h without textures, alpha and environment maps; one ray a pixel. */
#ifndef RAYBENCH_PICTURE_H
#define RAYBENCH_PICTURE_H

#include "accel/contract/raybench.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
  float diffuse[3], specular[3], emission[3], reflect[3], transmit[3], dispersion[3];
  float shininess, ior;
  uint32_t fresnel, thin; /* 0 or 1 */
} rb_material;

enum { RB_LIGHT_POINT, RB_LIGHT_DIRECTIONAL, RB_LIGHT_SPOT };
typedef struct {
  float position[3], intensity[3], direction[3];
  float cos_inner, cos_outer, range;
  uint32_t kind, falloff;
} rb_light;

/* All rays of one depth: camera rays, then reflected and refracted ones. */
typedef struct {
  uint64_t rays, hits, shadow, blocked, reflections, refractions;
} rb_wave;

enum { RB_FRESNEL_MATERIAL, RB_FRESNEL_OFF, RB_FRESNEL_ON };
typedef struct {
  uint32_t struct_size, max_depth;
  const rb_geometry* geometry; /* of the tree */
  const float (*normals)[3];   /* NULL, or one a position: shading goes by them */
  const rb_material* materials;
  const uint32_t* material_of; /* one a primitive */
  const rb_light* lights;
  uint32_t material_count, light_count, fresnel;
  uint32_t shadow_rays;   /* 1: some light reaches some surface */
  uint32_t transmittance; /* 1: shadow rays gather what they pass; 0: the first hit blocks them */
  float min_contribution, ambient[3], background[3];
  const rb_ray* camera_rays;
  uint64_t ray_count;
  /* Results. */
  float (*pixels)[3];     /* one a camera ray */
  rb_wave* waves;         /* max_depth + 1 */
  double seconds, copies; /* by the device's clock */
} rb_picture;

/* Returns 0, or non-zero with one line in `error`. The tree is one of the same plugin. */
#define RAYBENCH_PICTURE_ENTRY "raybench_picture"
typedef int (*rb_picture_entry)(const rb_tree* tree, rb_picture* picture, char* error, size_t error_size);

#ifdef __cplusplus
}
#endif
#endif
