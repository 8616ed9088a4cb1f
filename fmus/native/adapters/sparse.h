/* Bytes that are mostly zero, without their blocks of zeros.
 *
 * The packed form begins with one bit for each whole block of 64 bytes. The blocks that are not zero follow, and then the
 * bytes that fill no block.
 */
#ifndef VIBROIMPACT_SPARSE_H
#define VIBROIMPACT_SPARSE_H

#include <stdbool.h>
#include <stddef.h>

/* Write the packed form of `bytes` if it has at most `room` bytes. Returns the number of its bytes; `packed` is of no use
 * where this is more. */
size_t vi_sparse_pack(const unsigned char *bytes, size_t size, unsigned char *packed, size_t room);

/* Are `packed_size` bytes the packed form of `size` bytes? */
bool vi_sparse_fits(const unsigned char *packed, size_t packed_size, size_t size);

/* Write `size` bytes from their packed form. */
void vi_sparse_unpack(const unsigned char *packed, unsigned char *bytes, size_t size);

#endif
