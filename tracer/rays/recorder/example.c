/* A tiny ray caster that records its rays: what a renderer of yours would add is marked with RECORD.
 *
 *   cc -std=c11 -O2 example.c -o example -lm
 *   ./example out          writes out.ply, out_camera.rays and out_shadow.rays, says what it hit
 *   raybench run out.ply --rays out_camera.rays --rays out_shadow.rays
 *
 * The scene: a wavy ground of 32 x 32 x 2 triangles with an octahedron floating over it, one light. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define RAYBENCH_RECORDER_IMPLEMENTATION
#include "raybench_recorder.h"

enum {
  GRID = 32,
  SIDE = GRID + 1,
  VERTICES = SIDE * SIDE + 6,
  TRIANGLES = 2 * GRID * GRID + 8,
  PICTURE = 96
};

static float positions[VERTICES][3];
static uint32_t triangles[TRIANGLES][3];

static void MakeTriangle(int i, int a, int b, int c) {
  triangles[i][0] = (uint32_t)a, triangles[i][1] = (uint32_t)b, triangles[i][2] = (uint32_t)c;
}

static void MakeMesh(void) {
  static const float corners[6][3] = {{.7f, 0, 0},  {-.7f, 0, 0}, {0, .9f, 0},
                                      {0, -.9f, 0}, {0, 0, .7f},  {0, 0, -.7f}};
  int x, z, i, n = 0;
  for (z = 0; z < SIDE; ++z) {
    for (x = 0; x < SIDE; ++x) {
      float* p = positions[z * SIDE + x];
      p[0] = (float)x / 8 - 2, p[2] = (float)z / 8 - 2;
      p[1] = (float)((x * x + 3 * z) % 7) / 32; /* no sine: the same mesh on every machine */
    }
  }
  for (z = 0; z < GRID; ++z) {
    for (x = 0; x < GRID; ++x) {
      const int v = z * SIDE + x;
      MakeTriangle(n++, v, v + SIDE, v + 1);
      MakeTriangle(n++, v + 1, v + SIDE, v + SIDE + 1);
    }
  }
  for (i = 0; i < 6; ++i) {
    float* p = positions[SIDE * SIDE + i];
    p[0] = corners[i][0], p[1] = corners[i][1] + 1.5f, p[2] = corners[i][2];
  }
  for (i = 0; i < 8; ++i) {
    const int first = SIDE * SIDE, a = first + (i & 1), b = first + 2 + (i >> 1 & 1),
              c = first + 4 + (i >> 2 & 1);
    MakeTriangle(n++, a, b, c);
  }
}

static double Dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void Cross(const double a[3], const double b[3], double c[3]) {
  c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
}

/* t of the hit with a triangle, or INFINITY (Moeller and Trumbore 1997), in double. */
static double Intersect(const rbrec_ray* ray, int triangle) {
  double e1[3], e2[3], s[3], d[3], p[3], q[3], det, u, v, t;
  const float *a = positions[triangles[triangle][0]], *b = positions[triangles[triangle][1]],
              *c = positions[triangles[triangle][2]];
  int k;
  for (k = 0; k < 3; ++k) {
    e1[k] = (double)b[k] - a[k], e2[k] = (double)c[k] - a[k];
    s[k] = (double)ray->org[k] - a[k], d[k] = ray->dir[k];
  }
  Cross(d, e2, p);
  Cross(s, e1, q);
  det = Dot(e1, p);
  if (det == 0) return INFINITY;
  u = Dot(s, p) / det, v = Dot(d, q) / det, t = Dot(e2, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && t > ray->tnear && t <= ray->tfar ? t : INFINITY;
}

/* The nearest triangle, or -1. */
static int Closest(const rbrec_ray* ray, double* t) {
  int i, nearest = -1;
  *t = INFINITY;
  for (i = 0; i < TRIANGLES; ++i) {
    const double ti = Intersect(ray, i);
    if (ti < *t) *t = ti, nearest = i;
  }
  return nearest;
}

static rbrec_ray CameraRay(int x, int y) {
  rbrec_ray ray = {{0.3f, 2.2f, 4.5f}, 0, {0, 0, 0}, INFINITY};
  ray.dir[0] = ((float)x + 0.5f) / PICTURE - 0.5f;
  ray.dir[1] = 0.1f - ((float)y + 0.5f) / PICTURE;
  ray.dir[2] = -1;
  return ray;
}

/* From just in front of a hit to just before the light; dir is not normalised, so the light is at t = 1. */
static rbrec_ray ShadowRay(const rbrec_ray* ray, double t) {
  static const float light[3] = {2, 5, 3};
  rbrec_ray shadow = {{0, 0, 0}, 1e-4f, {0, 0, 0}, 0.999f};
  int k;
  for (k = 0; k < 3; ++k) {
    shadow.org[k] = (float)(ray->org[k] + t * ray->dir[k]);
    shadow.dir[k] = light[k] - shadow.org[k];
  }
  return shadow;
}

static int Fail(const char* message) {
  fprintf(stderr, "example: %s\n", message);
  return EXIT_FAILURE;
}

int main(int argc, char** argv) {
  static rbrec_set camera, shadow; /* 10 KB each */
  rbrec_scene scene;
  char path[512];
  int x, y;
  unsigned long hits = 0, blocked = 0, prims = 0;
  if (argc != 2) return Fail("give it one argument: the stem of the files to write");
  MakeMesh();

  /* RECORD: the mesh, once; then a set for each kind of ray. */
  snprintf(path, sizeof path, "%s.ply", argv[1]);
  if (rbrec_mesh(&scene, path, positions[0], VERTICES, 0, triangles[0], TRIANGLES) != RBREC_OK)
    return Fail(scene.message);
  snprintf(path, sizeof path, "%s_camera.rays", argv[1]);
  rbrec_begin(&camera, path, &scene, "camera", 0, RBREC_CLOSEST, "raybench recorder example");
  snprintf(path, sizeof path, "%s_shadow.rays", argv[1]);
  rbrec_begin(&shadow, path, &scene, "shadow", 0, RBREC_ANY, "raybench recorder example");

  for (y = 0; y < PICTURE; ++y) {
    for (x = 0; x < PICTURE; ++x) {
      const rbrec_ray ray = CameraRay(x, y);
      double t;
      const int nearest = Closest(&ray, &t);
      rbrec_add(&camera, &ray, 1); /* RECORD: where a ray is traced */
      if (nearest < 0) continue;
      ++hits, prims += (unsigned long)nearest;
      {
        const rbrec_ray to_light = ShadowRay(&ray, t);
        blocked += Closest(&to_light, &t) >= 0;
        rbrec_add(&shadow, &to_light, 1); /* RECORD */
      }
    }
  }

  /* RECORD: at the end. Errors on the way are told here. */
  if (rbrec_end(&camera) != RBREC_OK) return Fail(camera.message);
  if (rbrec_end(&shadow) != RBREC_OK) return Fail(shadow.message);
  printf("scene %08lx%08lx\n", (unsigned long)(scene.hash >> 32), (unsigned long)(scene.hash & 0xFFFFFFFFu));
  printf("camera %lu rays, %lu hit, sum of triangles hit %lu\n", (unsigned long)camera.count, hits, prims);
  printf("shadow %lu rays, %lu blocked\n", (unsigned long)shadow.count, blocked);
  return EXIT_SUCCESS;
}
