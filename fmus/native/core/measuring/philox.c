#include "measuring/philox.h"

enum { ROUNDS = 10 };

void vi_philox(uint32_t counter[4], uint32_t key0, uint32_t key1)
{
    for (int round = 0; round < ROUNDS; ++round) {
        const uint64_t even = (uint64_t)0xD2511F53u * counter[0], odd = (uint64_t)0xCD9E8D57u * counter[2];
        counter[0] = (uint32_t)(odd >> 32) ^ counter[1] ^ key0;
        counter[2] = (uint32_t)(even >> 32) ^ counter[3] ^ key1;
        counter[1] = (uint32_t)odd;
        counter[3] = (uint32_t)even;
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
}
