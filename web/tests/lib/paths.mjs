// Paths of the project.
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

export const ROOT = dirname(dirname(dirname(dirname(fileURLToPath(import.meta.url)))));
export const SITE = join(ROOT, 'target/web/site');
export const ENGINE = join(ROOT, 'target/web/engine');
export const scene = (name) => join(ROOT, 'testdata', name);
