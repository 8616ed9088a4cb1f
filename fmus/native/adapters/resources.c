#include "resources.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>
#endif

/* Paths are UTF-8 in FMI. */
static FILE *open_to_read(const char *path)
{
#if defined(_WIN32)
    wchar_t wide[VI_PATH_LENGTH];
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, VI_PATH_LENGTH) > 0 ? _wfopen(wide, L"rb") : NULL;
#else
    return fopen(path, "rb");
#endif
}

FILE *vi_resource_open(const char *folder, const char *name)
{
    char path[VI_PATH_LENGTH];
    const int length = folder != NULL ? snprintf(path, sizeof path, "%s/%s", folder, name) : 0;
    return length > 0 && length < VI_PATH_LENGTH ? open_to_read(path) : NULL;
}

void vi_sizes_read(const char *folder, vi_sizes *sizes)
{
    sizes->count = 0;
    FILE *file = vi_resource_open(folder, "sizes.txt");
    if (file == NULL) {
        return;
    }
    /* the widths are those of `block` and of an int */
    while (sizes->count < VI_MOST_SIZES
           && fscanf(file, "%15s %8d", sizes->of[sizes->count].block, &sizes->of[sizes->count].size) == 2) {
        sizes->count += 1;
    }
    (void)fclose(file);
}

size_t vi_starts_read(const char *folder, vi_start starts[], size_t most)
{
    FILE *file = vi_resource_open(folder, "starts.txt");
    if (file == NULL) {
        return 0;
    }
    size_t count = 0;
    /* the widths are those of the two numbers */
    while (count < most && fscanf(file, "%9" SCNu32 " %16" SCNx64, &starts[count].reference, &starts[count].bits) == 2) {
        count += 1;
    }
    (void)fclose(file);
    return count;
}

size_t vi_references_read(const char *folder, uint32_t references[], size_t most)
{
    FILE *file = vi_resource_open(folder, "references.txt");
    if (file == NULL) {
        return 0;
    }
    size_t count = 0;
    while (count < most && fscanf(file, "%9" SCNu32, &references[count]) == 1) { /* the width of a number */
        count += 1;
    }
    (void)fclose(file);
    return count;
}

VI_RARE size_t vi_pairs_read(const char *folder, vi_derivative_pair pairs[], size_t most)
{
    FILE *file = vi_resource_open(folder, "sensitivities.txt");
    if (file == NULL) {
        return 0;
    }
    size_t count = 0;
    while (count < most && fscanf(file, "%9" SCNu32 " %9" SCNu32, &pairs[count].unknown, &pairs[count].known) == 2) {
        count += 1;
    }
    (void)fclose(file);
    return count;
}

static bool hexadecimal(char c)
{
    return c != '\0' && strchr("0123456789abcdefABCDEF", c) != NULL;
}

/* Undo percent-encoding; false when the path is too long. */
static bool decode(const char *text, char path[VI_PATH_LENGTH])
{
    size_t used = 0;
    while (*text != '\0' && used + 1 < VI_PATH_LENGTH) {
        if (text[0] == '%' && hexadecimal(text[1]) && hexadecimal(text[2])) {
            const char digits[] = {text[1], text[2], '\0'};
            path[used++] = (char)strtol(digits, NULL, 16);
            text += 3;
        } else {
            path[used++] = *text++;
        }
    }
    path[used] = '\0';
    return *text == '\0';
}

/* The path in a URI of scheme `file`, still encoded; NULL for another scheme. */
static const char *path_of(const char *uri)
{
    static const char scheme[] = "file:";
    if (strncmp(uri, scheme, sizeof scheme - 1) != 0) {
        return NULL;
    }
    const char *path = uri + sizeof scheme - 1;
    if (strncmp(path, "//", 2) == 0) { /* skip the host, empty or this machine */
        path = strchr(path + 2, '/');
    }
#if defined(_WIN32)
    if (path != NULL && path[0] == '/' && path[1] != '\0' && path[2] == ':') {
        path += 1; /* file:///C:/folder */
    }
#endif
    return path;
}

const char *vi_folder_of_uri(const char *uri, char folder[VI_PATH_LENGTH])
{
    const char *path = uri != NULL ? path_of(uri) : NULL;
    return path != NULL && decode(path, folder) ? folder : NULL;
}
