/* What an exported FMU says of itself in its folder of resources, in plain lines.
 *
 * sizes.txt: how many of each repeated block of variables the model description has, such as `modes 8`.
 * starts.txt: start values that are not the component's own, such as `17 4000000000000000`: value reference, then the
 * 64 bits of the number in hexadecimal digits, which no locale reads in another way.
 * references.txt (FMI 3.0): the component's value references of the variables of the description, which numbers them
 * from 1 on in their order: OMSimulator takes the references in its dependencies for places.
 */
#ifndef VIBROIMPACT_RESOURCES_H
#define VIBROIMPACT_RESOURCES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

enum { VI_MOST_SIZES = 8, VI_BLOCK_LENGTH = 16, VI_PATH_LENGTH = 4096 };

typedef struct {
    int count;
    struct {
        char block[VI_BLOCK_LENGTH];
        int size;
    } of[VI_MOST_SIZES];
} vi_sizes;

/* A start value: the bits of a double or of an int64_t. */
typedef struct {
    uint32_t reference;
    uint64_t bits;
} vi_start;

/* Read the sizes from the folder of resources. None when it is NULL, or has no such file. */
void vi_sizes_read(const char *folder, vi_sizes *sizes);

/* Read at most `most` start values, and return how many there are. 0 when the folder is NULL, or has no such file. */
size_t vi_starts_read(const char *folder, vi_start starts[], size_t most);

/* Read at most `most` value references of the component, and return how many there are; 0 likewise. */
size_t vi_references_read(const char *folder, uint32_t references[], size_t most);

/* Open a file of the folder of resources to be read, byte by byte; NULL when the folder is, or there is no such file. */
FILE *vi_resource_open(const char *folder, const char *name);

/* The folder in a URI (FMI 2.0): file:///path, file://localhost/path or file:/path, percent-encoded. NULL when it is none. */
const char *vi_folder_of_uri(const char *uri, char folder[VI_PATH_LENGTH]);

#endif
