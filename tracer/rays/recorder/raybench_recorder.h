/* raybench_recorder.h - records the rays of your program, and the mesh they go into, for raybench.
 *
 * One header, C99 or C++11, no dependency but the C library. In exactly one source file:
 *
 *   #define RAYBENCH_RECORDER_IMPLEMENTATION
 *   #include "raybench_recorder.h"
 *
 * Then, for instance (example.c beside this file is a complete program):
 *
 *   rbrec_scene scene;
 *   rbrec_set shadow;
 *   if (rbrec_mesh(&scene, "out.ply", positions, vertex_count, 0, indices, triangle_count) != RBREC_OK ||
 *       rbrec_begin(&shadow, "out_shadow.rays", &scene, "shadow", 0, RBREC_ANY, "my engine 1.0") != RBREC_OK)
 *     ...
 *   rbrec_add(&shadow, rays, n);    any number of times
 *   rbrec_end(&shadow);             now the file is there, complete
 *
 *   $ raybench rays info out_shadow.rays
 *   $ raybench run out.ply --rays out_shadow.rays
 *
 * What to hand over:
 * - The mesh: one list of triangles in the coordinates in which you trace. Flatten instances, displace and
 *   subdivide first: raybench sees what you hand over and nothing else. Positions must be finite.
 * - Rays: org + t * dir with tnear < t <= tfar, in the same coordinates. dir has any length but 0, and t is
 *   measured in it: a shadow ray may have dir = light - org and tfar just below 1, or a unit dir and tfar
 *   just below the distance. tnear is finite and at least 0. Without a far end, tfar is INFINITY.
 *   raybench counts NaN and zero directions and replaces them by rays that miss: you need not filter.
 *   A ray carries nothing else: no masks, no time, no primitive to skip.
 * - One set for each kind of ray and bounce, closest-hit and any-hit rays apart, in the order in which you
 *   trace them: order decides caches and coherence. A million rays of a set are plenty.
 *
 * Threads: nothing here is shared between sets, so threads may record different sets at once. Calls on the
 * same set must not overlap: collect a block of rays in each thread and add it under a lock; blocks stay
 * together.
 *
 * Memory: 8 KB in each rbrec_set; rays go to the disk in chunks. Nothing is allocated. Files are written as
 * NAME.tmp and renamed at the end, so that a NAME.rays or NAME.ply is always complete.
 *
 * Errors: every function returns RBREC_OK or what went wrong, and leaves one line in `message`. After an
 * error a set stays in it: rbrec_add() may be called without checking and rbrec_end() tells, leaving no file.
 *
 * The format, byte by byte: RAYS.md of raybench. Licence: MIT, as raybench's own code. */
#ifndef RAYBENCH_RECORDER_H
#define RAYBENCH_RECORDER_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#ifdef __cplusplus
extern "C" {
#endif

enum rbrec_status {
  RBREC_OK = 0,
  RBREC_BAD_ARGUMENT = 1, /* NULL, a name that is not allowed, an index or a position out of range */
  RBREC_CANNOT_WRITE = 2, /* no such folder, no permission, disk full */
  RBREC_EMPTY = 3         /* a set without rays: there is no file for it */
};

enum { RBREC_CLOSEST = 0, RBREC_ANY = 1 };

/* Has the layout of raybench's rb_ray; 32 bytes. */
typedef struct {
  float org[3], tnear, dir[3], tfar;
} rbrec_ray;

/* The geometry that rays belong to. */
typedef struct {
  uint64_t hash;
  char name[104]; /* for people: the file of the mesh */
  char message[256];
} rbrec_scene;

/* A ray set being recorded. Its fields are not yours, but for `count` and `message`. */
typedef struct {
  uint64_t count; /* rays so far */
  char message[256];
  int status;
  FILE* file;
  uint64_t state;
  size_t buffered;
  unsigned char header[256], buffer[256 * 32];
  char path[1024], temporary[1032];
} rbrec_set;

/* Writes the mesh as binary PLY and fills `scene`. `path` NULL: writes nothing, only fills `scene`, for a
 * mesh that lies in a file already with the same vertices and triangles in the same order. positions: x, y, z
 * of each vertex, `stride` bytes from one vertex to the next (0: 12, packed). indices: three for each
 * triangle, from 0; NULL: vertices 0 1 2, 3 4 5, ... */
int rbrec_mesh(rbrec_scene* scene, const char* path, const float* positions, uint64_t vertex_count,
               size_t stride, const uint32_t* indices, uint64_t triangle_count);

/* Starts a set. path: "NAME.rays"; NAME is the set's label in raybench. kind: what rays these are, such as
 * "camera", "shadow", "reflection", "diffuse"; 1 to 31 of a-z, 0-9, _. depth: bounces before these rays, 0
 * for camera rays and shadow rays from their hits. query: RBREC_CLOSEST or RBREC_ANY. software: your program
 * and its version, or NULL. */
int rbrec_begin(rbrec_set* set, const char* path, const rbrec_scene* scene, const char* kind, uint32_t depth,
                int query, const char* software);

/* Adds rays, in this order. */
int rbrec_add(rbrec_set* set, const rbrec_ray* rays, size_t count);

/* Completes the file; the set may be begun anew. */
int rbrec_end(rbrec_set* set);

/* Gives up instead: leaves no file. */
void rbrec_abort(rbrec_set* set);

#ifdef __cplusplus
}
#endif
#endif /* RAYBENCH_RECORDER_H */

#if defined(RAYBENCH_RECORDER_IMPLEMENTATION) && !defined(RAYBENCH_RECORDER_IMPLEMENTED)
#define RAYBENCH_RECORDER_IMPLEMENTED

#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- little-endian bytes, whatever the machine ---- */

static void rbrec_put32(unsigned char* to, uint32_t value) {
  int i;
  for (i = 0; i < 4; ++i) to[i] = (unsigned char)(value >> 8 * i);
}

static void rbrec_put64(unsigned char* to, uint64_t value) {
  rbrec_put32(to, (uint32_t)value);
  rbrec_put32(to + 4, (uint32_t)(value >> 32));
}

/* At most `size` bytes; what follows is zero already. */
static void rbrec_put_text(unsigned char* to, const char* text, size_t size) {
  for (; *text && size > 0; --size) *to++ = (unsigned char)*text++;
}

static uint32_t rbrec_bits(float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  return bits;
}

/* ---- the hash of RAYS.md ---- */

#define RBREC_HASH_START (((uint64_t)0xCBF29CE4u << 32) | 0x84222325u)

static uint64_t rbrec_mix(uint64_t state, uint64_t word) {
  state = (state ^ word) * (((uint64_t)0x9FB21C65u << 32) | 0x1E98DF25u);
  return state ^ (state >> 29);
}

static uint64_t rbrec_mix_bytes(uint64_t state, const unsigned char* bytes, size_t size) {
  size_t i;
  int k;
  for (i = 0; i < size; i += 8) { /* size is a multiple of 8 wherever this is called */
    uint64_t word = 0;
    for (k = 0; k < 8; ++k) word |= (uint64_t)bytes[i + (size_t)k] << 8 * k;
    state = rbrec_mix(state, word);
  }
  return state;
}

static uint64_t rbrec_hash_value(uint64_t state) {
  state = (state ^ (state >> 32)) * (((uint64_t)0xD6E8FEB8u << 32) | 0x6659FD93u);
  return state ^ (state >> 32);
}

/* Hashes an array of 32-bit values, one at a time: two make a word. */
typedef struct {
  uint64_t state;
  uint32_t half;
  int odd;
} rbrec_hasher;

static void rbrec_hash32(rbrec_hasher* hasher, uint32_t value) {
  if (hasher->odd) hasher->state = rbrec_mix(hasher->state, hasher->half | (uint64_t)value << 32);
  hasher->half = value;
  hasher->odd = !hasher->odd;
}

static void rbrec_hash_array_end(rbrec_hasher* hasher) {
  if (hasher->odd) hasher->state = rbrec_mix(hasher->state, hasher->half);
  hasher->odd = 0;
}

/* ---- messages and files ---- */

static int rbrec_fail(char message[256], int status, const char* path, const char* what) {
  snprintf(message, 256, "%.120s%s%.120s", path ? path : "", path ? ": " : "", what);
  return status;
}

static int rbrec_rename(const char* from, const char* to) {
  if (rename(from, to) == 0) return 1;
  remove(to); /* where rename() does not replace */
  return rename(from, to) == 0;
}

/* Closes `file`, good or not, and renames it; whatever fails, the temporary file is gone. */
static int rbrec_finish_file(FILE* file, int good, const char* temporary, const char* path) {
  good = fflush(file) == 0 && !ferror(file) && good;
  good = fclose(file) == 0 && good;
  good = good && rbrec_rename(temporary, path);
  if (!good) remove(temporary);
  return good;
}

/* ---- the mesh ---- */

static const char* rbrec_file_name(const char* path) {
  const char* name = path;
  for (; *path; ++path)
    if (*path == '/' || *path == '\\') name = path + 1;
  return name;
}

static void rbrec_vertex(const float* positions, size_t stride, uint64_t i, uint32_t bits[3]) {
  float p[3];
  int k;
  memcpy(p, (const unsigned char*)positions + (size_t)i * stride, sizeof p);
  for (k = 0; k < 3; ++k) bits[k] = rbrec_bits(p[k]);
}

static uint32_t rbrec_index(const uint32_t* indices, uint64_t i) {
  return indices ? indices[i] : (uint32_t)i;
}

static int rbrec_check_mesh(rbrec_scene* scene, const char* path, const float* positions,
                            uint64_t vertex_count, size_t stride, const uint32_t* indices,
                            uint64_t triangle_count) {
  uint64_t i;
  int k;
  uint32_t bits[3];
  char what[128];
  if (!positions || vertex_count < 3 || triangle_count < 1)
    return rbrec_fail(scene->message, RBREC_BAD_ARGUMENT, path, "a mesh needs 3 vertices and 1 triangle");
  if (vertex_count > 0xFFFFFFFEu || triangle_count > 0xFFFFFFFEu)
    return rbrec_fail(scene->message, RBREC_BAD_ARGUMENT, path,
                      "2^32 - 2 vertices and triangles are the most");
  for (i = 0; i < vertex_count; ++i) {
    rbrec_vertex(positions, stride, i, bits);
    for (k = 0; k < 3; ++k) {
      if ((bits[k] >> 23 & 255) != 255) continue;
      snprintf(what, sizeof what, "vertex %lu is not finite", (unsigned long)i);
      return rbrec_fail(scene->message, RBREC_BAD_ARGUMENT, path, what);
    }
  }
  for (i = 0; i < 3 * triangle_count; ++i) {
    if (indices ? indices[i] < vertex_count : i < vertex_count) continue;
    snprintf(what, sizeof what, "triangle %lu refers to vertex %lu of %lu", (unsigned long)(i / 3),
             (unsigned long)rbrec_index(indices, i), (unsigned long)vertex_count);
    return rbrec_fail(scene->message, RBREC_BAD_ARGUMENT, path, what);
  }
  return RBREC_OK;
}

static int rbrec_write_ply(const char* path, const float* positions, uint64_t vertex_count, size_t stride,
                           const uint32_t* indices, uint64_t triangle_count) {
  char temporary[1032];
  unsigned char bytes[13];
  uint32_t bits[3];
  uint64_t i;
  int k, good = 1;
  FILE* file;
  snprintf(temporary, sizeof temporary, "%s.tmp", path);
  file = fopen(temporary, "wb");
  if (!file) return 0;
  fprintf(file,
          "ply\nformat binary_little_endian 1.0\ncomment written by raybench_recorder.h\n"
          "element vertex %lu\nproperty float x\nproperty float y\nproperty float z\n"
          "element face %lu\nproperty list uchar uint vertex_indices\nend_header\n",
          (unsigned long)vertex_count, (unsigned long)triangle_count);
  for (i = 0; i < vertex_count && good; ++i) {
    rbrec_vertex(positions, stride, i, bits);
    for (k = 0; k < 3; ++k) rbrec_put32(bytes + 4 * k, bits[k]);
    good = fwrite(bytes, 12, 1, file) == 1;
  }
  bytes[0] = 3;
  for (i = 0; i < triangle_count && good; ++i) {
    for (k = 0; k < 3; ++k) rbrec_put32(bytes + 1 + 4 * k, rbrec_index(indices, 3 * i + (uint64_t)k));
    good = fwrite(bytes, 13, 1, file) == 1;
  }
  return rbrec_finish_file(file, good, temporary, path);
}

int rbrec_mesh(rbrec_scene* scene, const char* path, const float* positions, uint64_t vertex_count,
               size_t stride, const uint32_t* indices, uint64_t triangle_count) {
  rbrec_hasher hasher;
  uint64_t i;
  int k, status;
  uint32_t bits[3];
  if (!scene) return RBREC_BAD_ARGUMENT;
  memset(scene, 0, sizeof *scene);
  if (stride == 0) stride = 3 * sizeof(float);
  if (path && strlen(path) >= 1024)
    return rbrec_fail(scene->message, RBREC_BAD_ARGUMENT, path, "the path is too long");
  status = rbrec_check_mesh(scene, path, positions, vertex_count, stride, indices, triangle_count);
  if (status != RBREC_OK) return status;

  hasher.state = RBREC_HASH_START, hasher.half = 0, hasher.odd = 0;
  hasher.state = rbrec_mix(hasher.state, vertex_count);
  hasher.state = rbrec_mix(hasher.state, triangle_count);
  hasher.state = rbrec_mix(hasher.state, 0); /* procedural primitives */
  for (i = 0; i < vertex_count; ++i) {
    rbrec_vertex(positions, stride, i, bits);
    for (k = 0; k < 3; ++k) rbrec_hash32(&hasher, bits[k]);
  }
  rbrec_hash_array_end(&hasher);
  for (i = 0; i < 3 * triangle_count; ++i) rbrec_hash32(&hasher, rbrec_index(indices, i));
  rbrec_hash_array_end(&hasher);
  scene->hash = rbrec_hash_value(hasher.state);

  if (!path) return RBREC_OK;
  rbrec_put_text((unsigned char*)scene->name, rbrec_file_name(path), sizeof scene->name - 1);
  if (!rbrec_write_ply(path, positions, vertex_count, stride, indices, triangle_count))
    return rbrec_fail(scene->message, RBREC_CANNOT_WRITE, path, "cannot be written");
  return RBREC_OK;
}

/* ---- the rays ---- */

static int rbrec_fail_set(rbrec_set* set, int status, const char* what) {
  if (set->file) {
    fclose(set->file);
    remove(set->temporary);
    set->file = NULL;
  }
  return set->status = rbrec_fail(set->message, status, set->path, what);
}

static int rbrec_is_kind(const char* kind) {
  const size_t n = kind ? strlen(kind) : 0;
  return n >= 1 && n <= 31 && strspn(kind, "abcdefghijklmnopqrstuvwxyz0123456789_") == n;
}

int rbrec_begin(rbrec_set* set, const char* path, const rbrec_scene* scene, const char* kind, uint32_t depth,
                int query, const char* software) {
  static const unsigned char magic[8] = {0x89, 'R', 'A', 'Y', 'S', 0x0D, 0x0A, 0x1A};
  unsigned char* h;
  if (!set) return RBREC_BAD_ARGUMENT;
  memset(set, 0, sizeof *set);
  if (!path || strlen(path) >= sizeof set->path)
    return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "no path, or one that is too long");
  strcpy(set->path, path);
  if (!scene || scene->hash == 0)
    return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "no scene: call rbrec_mesh()");
  if (!rbrec_is_kind(kind))
    return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "a kind has 1 to 31 of a-z, 0-9 and _");
  if (query != RBREC_CLOSEST && query != RBREC_ANY)
    return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "a query is RBREC_CLOSEST or RBREC_ANY");

  h = set->header;
  memcpy(h, magic, sizeof magic);
  rbrec_put32(h + 8, 1);
  rbrec_put32(h + 12, sizeof set->header);
  rbrec_put32(h + 24, (uint32_t)query);
  rbrec_put32(h + 28, depth);
  rbrec_put64(h + 32, scene->hash);
  rbrec_put_text(h + 48, kind, 31);
  rbrec_put_text(h + 80, "recorded", 15);
  rbrec_put_text(h + 96, software ? software : "raybench_recorder.h", 47);
  rbrec_put_text(h + 144, scene->name, 103);

  set->state = RBREC_HASH_START;
  snprintf(set->temporary, sizeof set->temporary, "%s.tmp", path);
  set->file = fopen(set->temporary, "wb");
  /* Count and checksums are not known yet: the header is written again at the end. */
  if (!set->file || fwrite(h, sizeof set->header, 1, set->file) != 1)
    return rbrec_fail_set(set, RBREC_CANNOT_WRITE, "cannot be written");
  return RBREC_OK;
}

static int rbrec_flush(rbrec_set* set) {
  if (set->buffered == 0) return RBREC_OK;
  set->state = rbrec_mix_bytes(set->state, set->buffer, set->buffered);
  if (fwrite(set->buffer, set->buffered, 1, set->file) != 1)
    return rbrec_fail_set(set, RBREC_CANNOT_WRITE, "cannot be written; is the disk full?");
  set->buffered = 0;
  return RBREC_OK;
}

int rbrec_add(rbrec_set* set, const rbrec_ray* rays, size_t count) {
  size_t i;
  int k;
  if (!set) return RBREC_BAD_ARGUMENT;
  if (set->status != RBREC_OK) return set->status;
  if (!set->file) return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "rays are added to a set that is not begun");
  if (!rays && count > 0) return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "no rays");
  if (count > 0xFFFFFFFFu - set->count)
    return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "2^32 - 1 rays are the most");
  for (i = 0; i < count; ++i) {
    unsigned char* to = set->buffer + set->buffered;
    for (k = 0; k < 3; ++k) {
      rbrec_put32(to + 4 * k, rbrec_bits(rays[i].org[k]));
      rbrec_put32(to + 16 + 4 * k, rbrec_bits(rays[i].dir[k]));
    }
    rbrec_put32(to + 12, rbrec_bits(rays[i].tnear));
    rbrec_put32(to + 28, rbrec_bits(rays[i].tfar));
    set->buffered += 32;
    if (set->buffered == sizeof set->buffer && rbrec_flush(set) != RBREC_OK) return set->status;
  }
  set->count += count;
  return RBREC_OK;
}

int rbrec_end(rbrec_set* set) {
  unsigned char* h;
  FILE* file;
  int good;
  if (!set) return RBREC_BAD_ARGUMENT;
  if (set->status != RBREC_OK) return set->status;
  if (!set->file) return rbrec_fail_set(set, RBREC_BAD_ARGUMENT, "a set ends that is not begun");
  if (set->count == 0) return rbrec_fail_set(set, RBREC_EMPTY, "no rays were added, so there is no file");
  if (rbrec_flush(set) != RBREC_OK) return set->status;
  h = set->header;
  rbrec_put64(h + 16, set->count);
  rbrec_put64(h + 40, rbrec_hash_value(set->state));
  rbrec_put64(h + 248, rbrec_hash_value(rbrec_mix_bytes(RBREC_HASH_START, h, 248)));
  file = set->file;
  set->file = NULL;
  rewind(file);
  good = fwrite(h, sizeof set->header, 1, file) == 1;
  if (!rbrec_finish_file(file, good, set->temporary, set->path))
    return rbrec_fail_set(set, RBREC_CANNOT_WRITE, "cannot be written; is the disk full?");
  return RBREC_OK;
}

void rbrec_abort(rbrec_set* set) {
  if (set && set->file) rbrec_fail_set(set, RBREC_EMPTY, "recording was given up");
}

#ifdef __cplusplus
}
#endif
#endif /* RAYBENCH_RECORDER_IMPLEMENTATION */
