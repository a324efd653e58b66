/* little.h - little-endian numbers at any alignment. */
#ifndef API_LITTLE_H
#define API_LITTLE_H

#include <stdint.h>
#include <string.h>

static inline uint32_t api_little_u32(const unsigned char *p)
{
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline uint64_t api_little_u64(const unsigned char *p)
{
    return api_little_u32(p) | (uint64_t)api_little_u32(p + 4) << 32;
}

static inline double api_little_double(const unsigned char *p)
{
    uint64_t bits = api_little_u64(p);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline float api_little_float(const unsigned char *p)
{
    uint32_t bits = api_little_u32(p);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#endif
