export * from "./frame";
export * as messages from "./messages";
export * from "./page";
export * from "./peer";
