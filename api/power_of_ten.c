#include "power_of_ten.h"

enum { LIMBS = 18 };

wide api_powers[POWER_MAX - POWER_MIN + 1];
uint64_t api_binades[2047];

/* The 128 leading bits of a long number, least limb first. */
static wide leading_bits(const uint64_t limbs[LIMBS])
{
    int top = LIMBS - 1;
    while (!limbs[top]) top--;
    int shift = __builtin_clzll(limbs[top]);
    wide high = (wide)limbs[top] << 64 | limbs[top - 1];
    return shift ? high << shift | limbs[top - 2] >> (64 - shift) : high;
}

static void fill_binades(void)
{
    for (int bits = 1; bits < 2047; bits++) {
        int e = bits - 1023, k = log10_of_binary(e);
        uint64_t above = log2_of_power(k + 1) == e ? (uint64_t)(power(k + 1) >> 64) : 0;
        api_binades[bits] = (above - 1) >> 11 << 11 | (uint64_t)(k + LOG10_BIAS);
    }
}

/* Before main, so that no thread can come too early; a few hundred microseconds. */
__attribute__((constructor)) static void fill_powers(void)
{
    uint64_t up[LIMBS] = {0, 0, 1}, down[LIMBS] = {0};
    down[LIMBS - 1] = 1; /* 2^1088: after 342 divisions by 5 more than 128 bits are left */
    for (int q = 0; q <= POWER_MAX; q++) {
        api_powers[q - POWER_MIN] = leading_bits(up);
        wide carry = 0;
        for (int i = 0; i < LIMBS; i++, carry >>= 64) {
            carry += (wide)up[i] * 5;
            up[i] = (uint64_t)carry;
        }
    }
    for (int q = -1; q >= POWER_MIN; q--) {
        wide rest = 0;
        for (int i = LIMBS - 1; i >= 0; i--, rest %= 5) {
            rest = rest << 64 | down[i];
            down[i] = (uint64_t)(rest / 5);
        }
        api_powers[q - POWER_MIN] = leading_bits(down);
    }
    fill_binades();
}
