/* What an exported FMU says about its size: resources/sizes.txt, plain lines such as `modes 8`. */
#ifndef VIBROIMPACT_RESOURCES_H
#define VIBROIMPACT_RESOURCES_H

enum { VI_MOST_SIZES = 8, VI_BLOCK_LENGTH = 16, VI_PATH_LENGTH = 4096 };

/* How many of each repeated block of variables ("modes", "contacts") the model description has. */
typedef struct {
    int count;
    struct {
        char block[VI_BLOCK_LENGTH];
        int size;
    } of[VI_MOST_SIZES];
} vi_sizes;

/* Read the sizes from the folder of resources (FMI 3.0). None when it is NULL, or has no such file. */
void vi_sizes_read(const char *folder, vi_sizes *sizes);

/* The same from its URI (FMI 2.0): file:///path, file://localhost/path or file:/path, percent-encoded. */
void vi_sizes_read_uri(const char *uri, vi_sizes *sizes);

#endif
